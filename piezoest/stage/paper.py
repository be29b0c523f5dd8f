"""The stage of the paper's experiment, rebuilt from its tables."""

import functools
import json
from importlib import resources
from typing import Any

from numpy.typing import ArrayLike

from piezoest._checks import non_negative, positive
from piezoest.models.creep import Creep
from piezoest.models.mechanics import MassSpringDamper
from piezoest.models.prandtl_ishlinskii import PrandtlIshlinskii
from piezoest.stage.instruments import Amplifier, Gauge
from piezoest.stage.stage import Schedule, SimulatedStage


class PaperStage(SimulatedStage):
    """The stage of Eielsen, Gravdahl and Pettersen (2012), simulated.

    It is a Prandtl-Ishlinskii operator with creep, fitted to the triangle rows of Tables I and II,
    with mechanics and instruments. It is not a Coleman-Hodgdon model, so the error of that model near
    the extrema is a result and not an assumption. All numbers and their sources are in
    ``piezoest/stage/paper_stage.json``; the effect of temperature is in `TemperatureLaw`.

    From the paper: sample rate, amplifier gain of 20 V/V, gauge of 5 µm/V, a scaling
    amplifier before the converter, programmable filters. Assumed, because the paper does not
    state them: resonance (780 Hz, damping ratio 0.02), 16-bit converters of ±10 V (6.1 mV a step at
    the stage), a voltage range of ±100 V and a slew rate of 1e5 V/s, a gauge range scaled to
    ±12.5 µm, white gauge noise of 1.2 nm rms, filters of second order at 10 kHz.

    Parameters
    ----------
    sample_rate : float
        [Hz]; 50 kHz as in the paper. The filters are left out if it is at most twice their cut-off.
    seed : int
        Start of the random numbers of the gauge's noise.
    gain_schedule : callable or array_like, shape (M, 2), optional
        Factor of the hysteresis over time, for ageing: see `SimulatedStage`.
    temperature : float, callable or array_like, shape (M, 2), optional
        Temperature [°C] over time: see `SimulatedStage`. Gain and shape change by `TemperatureLaw`, an
        assumption; at 20 °C, and without it, the stage is that of the tables.
    noise : float, optional
        Standard deviation of the gauge's white noise [µm]; the data file's if not given, 0 for none.
    quantisation : bool
        Whether the converters quantise.
    filters : bool
        Whether there are a reconstruction filter and an anti-aliasing filter.
    creep : bool
        Whether the stage creeps.
    mechanics : bool
        Whether the stage has its resonance.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    Source: Eielsen, Gravdahl and Pettersen, Rev. Sci. Instrum. 83, 085001 (2012), Sec. IV, Tables I and II.

    Examples
    --------
    >>> import piezoest as pz
    >>> stage = pz.PaperStage(sample_rate=10_000.0, seed=0)
    >>> x = stage.step(10.0)  # the reading [µm] after a voltage [V]
    >>> true = stage.displacement  # [µm]
    """

    __slots__ = ()

    def __init__(
        self,
        sample_rate: float = 50_000.0,
        seed: int = 0,
        *,
        gain_schedule: Schedule | ArrayLike | None = None,
        temperature: Schedule | ArrayLike | None = None,
        noise: float | None = None,
        quantisation: bool = True,
        filters: bool = True,
        creep: bool = True,
        mechanics: bool = True,
    ) -> None:
        data = _data()
        super().__init__(
            hysteresis=PrandtlIshlinskii(**_numbers(data["hysteresis"])),
            creep=Creep(**_numbers(data["creep"])) if creep else None,
            gain_schedule=gain_schedule,
            temperature=temperature,
            seed=seed,
            **mechanics_and_instruments(
                positive("sample_rate", sample_rate),
                noise=noise,
                quantisation=quantisation,
                filters=filters,
                mechanics=mechanics,
            ),
        )


def mechanics_and_instruments(
    sample_rate: float,
    *,
    noise: float | None = None,
    quantisation: bool = True,
    filters: bool = True,
    mechanics: bool = True,
) -> dict[str, Any]:
    """Arguments of a `SimulatedStage`, but for hysteresis, creep and schedules, as in `PaperStage`."""
    data = _data()
    amplifier, gauge = data["amplifier"], data["gauge"]
    return {
        "sample_rate": sample_rate,
        "mechanics": MassSpringDamper(**_numbers(data["mechanics"])) if mechanics else None,
        "amplifier": Amplifier(
            minimum=amplifier["minimum"],
            maximum=amplifier["maximum"],
            resolution=amplifier["resolution"] if quantisation else 0.0,
            slew_rate=amplifier["slew_rate"],
            cutoff=_cutoff(amplifier["cutoff"], sample_rate, filters),
        ),
        "gauge": Gauge(
            noise=gauge["noise"] if noise is None else non_negative("noise", noise),
            cutoff=_cutoff(gauge["cutoff"], sample_rate, filters),
            resolution=gauge["resolution"] if quantisation else 0.0,
            minimum=gauge["minimum"],
            maximum=gauge["maximum"],
        ),
    }


@functools.cache
def _data() -> dict[str, Any]:
    """The data file: a section for each part, its numbers and their origin."""
    text = resources.files("piezoest.stage").joinpath("paper_stage.json").read_text(encoding="utf-8")
    return json.loads(text)


def _numbers(section: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in section.items() if key != "origin"}


def _cutoff(cutoff: float, sample_rate: float, filters: bool) -> float | None:
    return cutoff if filters and cutoff < 0.5 * sample_rate else None
