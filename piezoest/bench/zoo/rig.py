"""A rig of the zoo: a stage of some family, what is around it, a reference and at most one fault."""

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.zoo import faults
from piezoest.bench.zoo.families import Reach
from piezoest.bench.zoo.faulty_stages import Drift, FaultyStage, hum
from piezoest.bench.zoo.references import Reference
from piezoest.compensators import VoltageLimits
from piezoest.models import Creep, MassSpringDamper
from piezoest.stage import Amplifier, Gauge, SimulatedStage

# Mechanics by name: natural frequency [Hz] and damping. The lag is a stage so damped that only its slow pole
# is left: a first-order low-pass.
MECHANICS = {"none": (0.0, 0.0), "200 Hz": (200.0, 0.01), "400 Hz": (400.0, 0.01), "780 Hz": (780.0, 0.02)}
DAMPING = 0.01  # of a resonance that is given as its frequency
LAG_DAMPING = 2.0
SLOW_POLE = LAG_DAMPING - (LAG_DAMPING**2 - 1.0) ** 0.5  # of the lag, relative to its natural frequency


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What lies between a controller and the hysteresis."""

    mechanics: str = "none"  # name in `MECHANICS`, another frequency as in "523 Hz", or "lag"
    lag: float = 0.0  # corner of the lag [Hz]; 0 without
    delay: int = 0  # of the reading, in samples
    noise: float = 0.0  # standard deviation of the gauge's noise [µm]
    resolution: float = 0.0  # of the gauge [µm]; 0 for none
    volts: float = 0.0  # step of the amplifier's converter [V]; 0 for none
    slew_rate: float = np.inf  # of the amplifier [V/s]
    creep: float = 0.0  # share of the displacement for each decade of time; 0 for none
    hum: float = 0.0  # amplitude of 50 Hz on the reading [µm]
    drift: float = 0.0  # of the stage [µm/s]

    @property
    def resonance(self) -> tuple[float, float]:
        """Natural frequency [Hz], 0 for none, and damping of the mechanics."""
        if self.mechanics == "lag":
            return self.lag / SLOW_POLE, LAG_DAMPING
        if self.mechanics in MECHANICS:
            return MECHANICS[self.mechanics]
        return float(self.mechanics.removesuffix(" Hz")), DAMPING


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rig:
    """One rig, and what it is to do."""

    seed: int  # start of all its random numbers
    family: str  # name in `piezoest.bench.zoo.families.FAMILIES`
    model: Any  # the hysteresis
    reach: Reach  # limits of the voltage
    sample_rate: float  # [Hz]
    gain: float  # mean slope over the reach [µm/V]
    width: float  # of the loop, relative
    around: Surroundings  # mechanics and instruments
    plain: Reference  # without the fault
    fault: faults.Fault = field(default_factory=faults.Fault)  # or none
    block: int = 1  # samples that are handed over at a time; 1 is one by one, by `step`

    @property
    def limits(self) -> VoltageLimits:
        """Limits of the voltage, as a controller gets them."""
        return VoltageLimits(self.reach.low, self.reach.high)

    @property
    def stroke(self) -> float:
        """Of the stage over the whole reach [µm]."""
        return 2.0 * self.reach.half * self.gain

    @property
    def reference(self) -> FloatArray:
        """What the controller is to follow, fault and all, shape (N,) [µm]."""
        return faults.changed_reference(self)

    @property
    def coordinates(self) -> tuple[float, FloatArray]:
        """Factor and zero of the gauge that the reference is meant in, see `faults.coordinates`."""
        return faults.coordinates(self)

    @property
    def gain_factor(self) -> FloatArray:
        """By what the fault has changed the gain, shape (N,)."""
        times, factors = zip(*(faults.gain_schedule(self) or [[0.0, 1.0]]), strict=True)
        return np.interp(np.arange(self.plain.values.size) / self.sample_rate, times, factors)

    @property
    def noise(self) -> float:
        """What nobody can foresee of a reading: noise, hum and steps, as a standard deviation [µm]."""
        own = self.around
        return float(np.sqrt(own.noise**2 + own.hum**2 / 2.0 + own.resolution**2 / 12.0))

    @property
    def judged_from(self) -> int:
        """First sample that is judged: after the beginning, or a fault at the start, and time to learn."""
        plain, fault = self.plain, self.fault
        ends = fault.stop if fault.mode == faults.TRANSIENT and fault.start == 0 else 0
        return min(max(plain.begins, ends) + self.learning, plain.values.size)

    @property
    def learning(self) -> int:
        """Samples that learning may take: two swings, and the block at whose end the first reading comes."""
        return round(1.5 * self.plain.cycle) + (self.block if self.block > 1 else 0)

    def seen(self, true: FloatArray) -> FloatArray:
        """True displacements, shape (N,) [µm], in the gauge's coordinates."""
        factor, zero = self.coordinates
        return factor * true + zero

    def stage(self, *, healthy: bool = False) -> Any:
        """Make the stage, at rest; a healthy one has no fault, noise, hum and drift."""
        own, fs = self.around, self.sample_rate
        stage: Any = SimulatedStage(
            fs,
            self.model,
            creep=Creep.logarithmic(own.creep, shortest=0.01, longest=10.0) if own.creep else None,
            mechanics=MassSpringDamper(*own.resonance) if own.resonance[0] else None,
            amplifier=Amplifier(
                self.reach.low, self.reach.high, resolution=own.volts, slew_rate=own.slew_rate
            ),
            gauge=Gauge() if healthy else Gauge(noise=own.noise, delay=own.delay, resolution=own.resolution),
            gain_schedule=None if healthy else faults.gain_schedule(self),
            seed=self.seed,
        )
        if healthy:
            return stage
        if own.drift:
            stage = Drift(stage, own.drift)
        if own.hum:
            stage = FaultyStage(stage, own.hum, seed=self.seed, reading=hum)
        return faults.faulty_stage(stage, self)

    def to_dict(self) -> dict[str, Any]:
        """All that was drawn, flat: columns of a row."""
        plain, fault, around = self.plain, self.fault, asdict(self.around)
        around["sensor_noise"] = around.pop("noise")
        return {
            "seed": self.seed, "family": self.family, "gain": self.gain, "width": self.width,
            "low": self.reach.low, "high": self.reach.high, "sample_rate": self.sample_rate, **around,
            "reference": plain.kind, "amplitude": plain.amplitude, "centre": plain.centre,
            "frequency": plain.frequency, "samples": plain.values.size, "block": self.block,
            "fault": fault.kind, "mode": fault.mode, "fault_size": fault.size,
            "fault_start": fault.start / self.sample_rate, "fault_stop": fault.stop / self.sample_rate,
        }  # fmt: skip
