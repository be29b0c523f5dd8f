"""A second stage to judge by: a Preisach plane with creep, of plays under a bell."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from piezoest._checks import positive
from piezoest.models.creep import Creep
from piezoest.models.preisach import Preisach
from piezoest.stage.paper import mechanics_and_instruments
from piezoest.stage.stage import Schedule, SimulatedStage

# Chosen, not fitted, and before any estimator was tried on it: a gain of about 0.15 µm/V and a loop
# about as open as the paper's at 5 µm, a density that halves within the range used, off its
# middle, and creep of 1.5 % in every decade from 3 ms to 30 s.
GAIN = 0.10  # µm/V
HYSTERETIC_SLOPE = 0.12  # µm/V, of all relays together at the centre
NARROW = 25.0  # V, over which the relays' number falls by e with their half-width
WIDEST, WIDTHS = 75.0, 60  # V
CENTRE, WIDTH = 20.0, 50.0  # V
CREEP = Creep.logarithmic(0.015, shortest=3e-3, longest=30.0)


class PreisachStage(SimulatedStage):
    """A simulated stage that is neither Coleman-Hodgdon nor Prandtl-Ishlinskii.

    Its hysteresis is a `Preisach` operator whose relays lie in a bell-shaped density around
    20 V: the loop is asymmetric and minor loops differ with their place. The density separates, so
    that each width of relay is a function of one play: the stage is of the family of the
    estimators that learn plays, and no independent judge of these. Creep is logarithmic
    over four decades. Mechanics and instruments are those of `PaperStage`.

    Parameters
    ----------
    sample_rate : float
        [Hz]. At twice the filters' cut-off (10 kHz) and below, the filters are left out.
    seed : int
        Start of the random numbers of the gauge's noise.
    gain_schedule, temperature, creep
        As in `PaperStage`.
    **rest
        As in `PaperStage`: noise, quantisation, filters, mechanics.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    An assumption throughout, chosen to be like a soft piezo ceramic and to be no model's own kind. Source of
    the operator: M. Brokate, J. Sprekels, Hysteresis and Phase Transitions, Springer 1996.

    Examples
    --------
    >>> import piezoest as pz
    >>> stage = pz.PreisachStage(sample_rate=10_000.0, seed=0)
    >>> x = stage.step(10.0)  # the reading [µm] after a voltage [V]
    """

    __slots__ = ()

    def __init__(
        self,
        sample_rate: float = 50_000.0,
        seed: int = 0,
        *,
        gain_schedule: Schedule | ArrayLike | None = None,
        temperature: Schedule | ArrayLike | None = None,
        creep: bool = True,
        **rest: Any,
    ) -> None:
        thresholds = WIDEST * (np.arange(WIDTHS) + 0.5) / WIDTHS
        share = np.exp(-thresholds / NARROW)
        super().__init__(
            hysteresis=Preisach(GAIN, thresholds, HYSTERETIC_SLOPE * share / share.sum(), CENTRE, WIDTH),
            creep=CREEP if creep else None,
            gain_schedule=gain_schedule,
            temperature=temperature,
            seed=seed,
            **mechanics_and_instruments(positive("sample_rate", sample_rate), **rest),
        )
