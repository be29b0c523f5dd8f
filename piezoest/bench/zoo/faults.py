"""What goes wrong on a rig of the zoo: which fault, from when to when, and what it does to the run."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from piezoest._checks import FloatArray
from piezoest.bench.zoo import faulty_stages as faulty

Rig = Any  # `piezoest.bench.zoo.rig.Rig`, whose module imports this one
NONE, START, TRANSIENT, PERMANENT = "none", "from-start", "transient", "permanent"
SETPOINT_NOISE = 1e-4  # µm, of a reference that rests


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a run."""

    kind: str = NONE  # name in `FAULTS`, or "none"
    start: int = 0  # first sample with it
    stop: int = 0  # first one without; the run's length if it stays
    size: float = 0.0  # what it is about: a factor, or µm
    lasting: bool = False  # whether it stays

    @property
    def mode(self) -> str:
        """From the start or later, and whether it stays, as one word."""
        if self.kind == NONE:
            return NONE
        return TRANSIENT if not self.lasting else START if self.start == 0 else PERMANENT

    @property
    def names(self) -> tuple[str, ...]:
        """What a controller is to call it; empty if it need not be noticed.

        Of what is there from the start only a stage that does not answer can be noticed.
        """
        kind = FAULTS.get(self.kind, Kind())
        if self.mode == START:
            return kind.names if kind.hides and STILL[0] in kind.names else ()
        return kind.names

    @property
    def right(self) -> bool:
        """Whether the gauge is right by definition, since the reference is in its coordinates."""
        return (self.kind == "zero-off" and self.lasting) or (
            self.kind == "sensor-factor" and self.mode == START
        )

    def within(self, n: int) -> Any:
        """Which of n samples have it."""
        k = np.arange(n)
        return (k >= self.start) & (k < self.stop)


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of fault."""

    # Of "from-start" (and it stays), "transient" and "permanent" (from a moment on).
    modes: tuple[str, ...] = (TRANSIENT, PERMANENT)
    # Draws the size from (random numbers, rig).
    size: Callable[[Any, Rig], float] = lambda rng, rig: 0.0
    # Maker of the faulty stage, and what it is given beside size, start, duration and seed.
    stage: Callable[..., Any] | None = None
    more: Callable[[Rig], dict[str, float]] = lambda rig: {}
    # Whether nothing can be learnt meanwhile: readings say nothing or lie, or the stage stands still.
    hides: bool = False
    partly: bool = False  # whether some readings are wrong and the others right
    names: tuple[str, ...] = ()  # what a controller may call it; empty if it need not be noticed


def faulty_stage(stage: Any, rig: Rig) -> Any:
    """Put the fault of a rig around its stage."""
    fault = rig.fault
    kind = FAULTS.get(fault.kind, Kind())
    if kind.stage is None:
        return stage
    # Half a sample early: whatever rounding does, the sample is the one meant.
    start = max(fault.start - 0.5, 0.0) / rig.sample_rate
    lasts = (fault.stop - max(fault.start, 0.5)) / rig.sample_rate
    duration = faulty.FOREVER if fault.lasting else lasts
    given = {"size": fault.size, **kind.more(rig)}
    return kind.stage(stage, start=start, duration=duration, seed=rig.seed, **given)


def _swing(rig: Rig) -> float:
    return 2.0 * rig.plain.amplitude


def _zero(rng: Any, rig: Rig) -> float:
    """20 µm, or the whole stroke where that is no size for the stage."""
    usual = rig.stroke > 10.0 and rng.random() < 0.6
    return float((20.0 if usual else rig.stroke) * rng.choice([-1.0, 1.0]))


ALL = (START, TRANSIENT, PERMANENT)
# Readings stand still, or are multiplied.
STILL, FACTORS = ("no response", "saturated"), ("reversed", "scaled")
ANY = (*STILL, *FACTORS, "zero moved")

FAULTS: dict[str, Kind] = {
    "amplifier-frozen": Kind(ALL, stage=faulty.FrozenAmplifier, hides=True, names=STILL),
    "stage-stuck": Kind(
        ALL, stage=faulty.StuckStage, more=lambda rig: {"noise": rig.around.noise}, hides=True,
        names=STILL,
    ),
    "sensor-constant": Kind(ALL, stage=faulty.StuckGauge, hides=True, names=STILL),
    "sensor-noise": Kind(
        ALL, size=lambda rng, rig: rig.plain.centre + rng.uniform(-1.0, 1.0) * rig.stroke,
        stage=faulty.reads("dead"), more=lambda rig: {"noise": 0.002 * _swing(rig)}, hides=True,
        names=ANY,
    ),
    "sensor-saturated": Kind(
        ALL, size=lambda rng, rig: 0.6 * rig.plain.amplitude, stage=faulty.reads("saturated"),
        more=lambda rig: {"centre": rig.plain.centre}, partly=True, names=("saturated",),
    ),
    "sensor-factor": Kind(
        ALL, size=lambda rng, rig: float(rng.choice([-1.0, 1e-3, 1e3])), stage=faulty.reads("scaled"),
        hides=True, names=FACTORS,
    ),
    "zero-off": Kind(ALL, size=_zero, stage=faulty.reads("moved"), hides=True, names=("zero moved",)),
    "zero-off-shifted": Kind(ALL, size=_zero, stage=faulty.reads("moved")),
    "spikes": Kind(
        ALL, size=lambda rng, rig: _swing(rig) * rng.choice([0.3, 1.0, 5.0]), stage=faulty.reads("spikes"),
        partly=True,
    ),
    "dropouts": Kind(
        ALL, size=lambda rng, rig: float(rng.choice([0.01, 0.2, 0.5])), stage=faulty.reads("missing")
    ),
    "gap": Kind(ALL, stage=faulty.reads("gap"), hides=True),
    "hum": Kind(
        ALL, size=lambda rng, rig: _usual(0.2, rig) if rng.random() < 0.5 else 0.05 * _swing(rig),
        stage=faulty.reads("hum"),
    ),
    "drift": Kind(
        ALL, size=lambda rng, rig: _swing(rig) * rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.3),
        stage=faulty.Drift,
        more=lambda rig: {
            "size": rig.fault.size * rig.sample_rate / max(rig.fault.stop - rig.fault.start, 1)
        },
    ),
    "gain-step": Kind(size=lambda rng, rig: float(rng.choice([0.7, 1.3]))),
    "amplitude-drop": Kind(size=lambda rng, rig: rng.uniform(0.1, 0.4)),
    "glitch": Kind(
        (TRANSIENT,), size=lambda rng, rig: _usual(rng.choice([1.0, 2.0, 10.0]), rig),
        stage=faulty.reads("moved"), hides=True,
    ),
    "dwell": Kind((TRANSIENT,)),
}  # fmt: skip


def _usual(size: float, rig: Rig) -> float:
    """A size [µm] for a stroke of about 30 µm, in proportion where the stroke is far from that."""
    return float(size) if 3.0 < rig.stroke < 300.0 else float(size) * rig.stroke / 30.0


def draw_fault(kind: str, mode: str | None, rng: Any, rig: Rig) -> Fault:
    """Draw when a fault is there and how large it is."""
    if kind == NONE:
        return Fault()
    if kind not in FAULTS:
        raise ValueError(f"fault must be none or one of {', '.join(FAULTS)}, got {kind!r}")
    modes = FAULTS[kind].modes
    drawn = str(rng.choice(modes))
    mode = drawn if mode is None else mode
    if mode not in modes:
        raise ValueError(f"{kind} is {', '.join(modes)}, got {mode!r}")
    reference = rig.plain
    n = reference.values.size
    size = FAULTS[kind].size(rng, rig)
    moment = reference.begins + round(rng.uniform(0.35, 0.5) * (n - reference.begins))
    lasts = round(rng.uniform(1.5, 4.0) * reference.cycle)
    early = rng.random() < 0.2
    if kind == "glitch":
        return Fault(kind, 0, 1, size)
    if mode == START:
        return Fault(kind, 0, n, size, lasting=True)
    if mode == PERMANENT:
        return Fault(kind, moment, n, size, lasting=True)
    start = 0 if early and START in modes else moment
    return Fault(kind, start, min(start + lasts, start + (n - moment) // 2), size)


def changed_reference(rig: Rig) -> FloatArray:
    """Reference of the run with its fault, shape (N,) [µm]."""
    fault, reference = rig.fault, rig.plain
    r = reference.values
    if fault.kind == "zero-off-shifted":
        return r + fault.size * fault.within(r.size)
    if fault.kind == "dwell":
        rng = np.random.default_rng(rig.seed)
        held = r[fault.start] + SETPOINT_NOISE * rng.standard_normal(fault.stop - fault.start)
        return np.concatenate((r[: fault.start], held, r[fault.start :]))[: r.size]
    if fault.kind == "amplitude-drop":
        # At the next way through the middle, so that nothing jumps.
        through = np.flatnonzero(np.diff(np.sign(r - reference.centre)) != 0.0)
        ends = [int(through[np.argmin(np.abs(through - k))]) + 1 for k in (fault.start, fault.stop)]
        small = np.arange(r.size) >= ends[0]
        if not fault.lasting:
            small &= np.arange(r.size) < ends[1]
        return np.where(small, reference.centre + fault.size * (r - reference.centre), r)
    return r


def gain_schedule(rig: Rig) -> list[list[float]] | None:
    """Factor of the gain over time, for a `SimulatedStage`; None without."""
    fault, sample_rate = rig.fault, rig.sample_rate
    if fault.kind != "gain-step":
        return None
    rows = [[0.0, 1.0], [(fault.start - 1) / sample_rate, 1.0], [fault.start / sample_rate, fault.size]]
    if not fault.lasting:
        rows += [[fault.stop / sample_rate, fault.size], [(fault.stop + 1) / sample_rate, 1.0]]
    return rows


def coordinates(rig: Rig) -> tuple[float, FloatArray]:
    """Factor and zero (N,) [µm] of the gauge, in whose coordinates the reference is.

    A gauge that has been wrong from the start, or whose zero has moved for good, is right by definition.
    """
    fault, n = rig.fault, rig.plain.values.size
    zero = np.zeros(n)
    if fault.kind == "zero-off-shifted" or (fault.kind == "zero-off" and fault.right):
        zero = fault.size * fault.within(n)
    return (fault.size if fault.kind == "sensor-factor" and fault.right else 1.0), zero


def truthful(rig: Rig, first: int, x: FloatArray, seen: FloatArray, tolerance: float) -> Any:
    """Which readings say something true, as an oracle knows: it has `seen` them as a sound gauge would."""
    fault, told = rig.fault, np.isfinite(x)
    kind = FAULTS.get(fault.kind, Kind())
    if kind.hides and not fault.right:
        told &= ~fault.within(first + x.size)[first:]
    if kind.partly:
        told &= np.abs(np.where(told, x, np.inf) - seen) <= tolerance
    return told
