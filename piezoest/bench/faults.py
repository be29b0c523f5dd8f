"""What goes wrong in a laboratory, by name, and what becomes of it in the ring.

`piezoest.track` runs with a faulty stage as with a sound one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from piezoest._checks import positive
from piezoest.bench.faulty_stages import (
    Factor,
    FaultyStage,
    Gap,
    Missing,
    OffsetStep,
    Saturation,
    Spikes,
    Stuck,
    WeakAmplifier,
    WrongRate,
)
from piezoest.signals import Signal


@dataclass(frozen=True, slots=True)
class Fault:
    """A named fault.

    Parameters
    ----------
    name : str
        Stays what it is.
    description : str
        One line.
    outcome : str
        What the ring makes of it.
    stage : callable
        ``stage(make, sample_rate, seed)`` builds the faulty stage; ``make(sample_rate)`` is a
        sound one.
    reference_factor : float
        What the reference is multiplied by, where it is the reference that is wrong.
    ends : float or None
        Time after which all is well again [s]; None if it stays.
    recovers : bool
        Whether an estimator that rejects outliers settles again, or in spite of it.
    carried : float
        Error that no ring can know of, since its gauge is off by it [µm].
    """

    name: str
    description: str
    outcome: str
    stage: Callable[[Callable[[float], Any], float, int], Any]
    reference_factor: float = 1.0
    ends: float | None = None
    recovers: bool = False
    carried: float = 0.0

    def build(self, make: Callable[[float], Any], sample_rate: float, *, seed: int = 0) -> Any:
        """Make the faulty stage.

        Parameters
        ----------
        make : callable
            Sound stage for a sample rate [Hz], such as `PaperStage`.
        sample_rate : float
            What the ring takes for it [Hz].
        seed : int
            Start of the fault's random numbers.

        Returns
        -------
        FaultyStage
        """
        return self.stage(make, positive("sample_rate", sample_rate), seed)

    def reference(self, r: Signal) -> Signal:
        """Reference under this fault: the same one, or one too large for the stage.

        Parameters
        ----------
        r : Signal
            [µm].
        """
        return r if self.reference_factor == 1.0 else self.reference_factor * r


def _on(fault: Callable[..., FaultyStage], **arguments: float) -> Callable[..., FaultyStage]:
    def stage(make: Callable[[float], Any], sample_rate: float, seed: int) -> FaultyStage:
        return fault(make(sample_rate), **arguments, seed=seed)

    return stage


def _wrong_rate(make: Callable[[float], Any], sample_rate: float, seed: int) -> FaultyStage:
    return WrongRate(make(sample_rate / 1.1), 1.1, seed=seed)


NONE = Fault("none", "Nothing is wrong.", "What there is to compare with.", _on(FaultyStage), recovers=True)

BEGINS = 1.0  # s: five periods at 5 Hz, most of what there is to learn

# Sizes are for a reference of 5 µm.
FAULTS: dict[str, Fault] = {
    fault.name: fault
    for fault in (
        Fault(
            "missing-1", "1 % of the samples missing.",
            "A sample without a reading is counted and teaches nothing; the model stays, the voltage "
            "goes on.",
            _on(Missing, share=0.01), recovers=True,
        ),
        Fault(
            "missing-50", "Half of the samples missing.",
            "The same; the samples that are left are enough.",
            _on(Missing, share=0.5), recovers=True,
        ),
        Fault(
            "gap", "No samples for 1 s.",
            "The compensator keeps its model, and learning goes on with the first readings.",
            _on(Gap, start=BEGINS), ends=BEGINS + 1.0, recovers=True,
        ),
        Fault(
            "spikes", "Five spikes of 10 µm a second.",
            "What the stage cannot have made is left out. An estimator that takes it is misled; the "
            "guard keeps the model in use, or a line.",
            _on(Spikes), recovers=True,
        ),
        Fault(
            "stuck", "The reading stands still for 1 s.",
            "A reading that does not change while the voltage moves is left out. An estimator that "
            "takes it is misled; the guard keeps the model in use, or a line.",
            _on(Stuck, start=BEGINS), ends=BEGINS + 1.0, recovers=True,
        ),
        Fault(
            "adc-saturation", "The converter ends at 4 µm.",
            "Readings at the end of the range stand still and are left out; the model is that of the "
            "rest of the loop, and misses more where nothing is read.",
            _on(Saturation, limit=4.0),
        ),
        Fault(
            "gauge-sign", "The gauge is wired the wrong way round.",
            "Nothing in the ring can know: it does what makes the gauge right, and the stage goes the "
            "wrong way. Within the voltage limits, with the guard and without.",
            _on(Factor, factor=-1.0),
        ),
        Fault(
            "voltage-sign", "The amplifier is wired the wrong way round.",
            "An admissible model rises with the voltage, so none fits, and the voltage goes to its "
            "limits. The guard keeps the model in use: it turns no gain round.",
            _on(WeakAmplifier, limit=100.0, factor=-1.0),
        ),
        Fault(
            "wrong-unit", "Readings in nm, taken for µm.",
            "The stage seems a thousand times as sensitive: it hardly moves, or the voltage goes to its "
            "limits where no admissible model is found. The guard keeps it from the latter.",
            _on(Factor, factor=1000.0),
        ),
        Fault(
            "offset-step", "The gauge's zero moves by 0.5 µm.",
            "The gauge is believed: an estimator that learns an offset takes the stage along by it, and "
            "settles.",
            _on(OffsetStep, start=BEGINS), recovers=True, carried=0.5,
        ),
        Fault(
            "voltage-saturation", "The amplifier ends at 25 V and does not say so.",
            "The stage does not get where the reference is, and a model of voltages that never came is "
            "wrong; once the guard sees that, a line takes its place.",
            _on(WeakAmplifier, limit=25.0),
        ),
        Fault(
            "out-of-range", "A reference four times as large, which the stage cannot reach.",
            "The voltage stays at its limits, the compensator says so, and the error is at least what "
            "is out of reach.",
            _on(FaultyStage), reference_factor=4.0,
        ),
        Fault(
            "wrong-rate", "The samples are 10 % slower than everyone believes.",
            "Hysteresis knows no time, and the default counts in travel and periods: nothing happens.",
            _wrong_rate, recovers=True,
        ),
    )
}  # fmt: skip
