"""The ring: what goes round it, and what it says when something does not fit."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import piezoest as pz

FS = 50_000.0
START = pz.ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036)
LINE = pz.LinearGain(0.14)
UNITY: Any = {"compensator": pz.LinearCompensator(pz.LinearGain(1.0))}
WAVE = np.sin(np.linspace(0.0, 6.0, 100))


def test_plain_arrays_need_a_rate() -> None:
    wire = SimpleNamespace(step=lambda u: u)
    with pytest.raises(ValueError, match="sample_rate is unknown"):
        pz.track(WAVE, stage=wire, **UNITY)
    record = pz.track(WAVE, stage=wire, **UNITY, sample_rate=100.0)
    np.testing.assert_allclose(record.error, 0.0, atol=1e-12)
    assert (record.time[1], record.theta.shape) == (0.01, (100, 0))
    assert record == record
    assert record != pz.track(WAVE, stage=wire, **UNITY, sample_rate=100.0)
    with pytest.raises(ValueError, match="has no period"):
        record.max_error(last_periods=1)
    record = pz.track(pz.signals.sine(1.0, 5.0, 2, 100.0), stage=wire, **UNITY)
    with pytest.raises(ValueError, match="last_periods is 5, the record has 2 periods"):
        record.max_error(last_periods=5)
    with pytest.raises(ValueError, match="sample rates differ"):
        pz.track(WAVE, stage=pz.PaperStage(sample_rate=FS), **UNITY, sample_rate=100.0)
    nothing: Any = None
    with pytest.raises(ValueError, match=r"must have step\(u\)"):
        pz.track([0.0], stage=object(), controller=1, sample_rate=FS)
    with pytest.raises(ValueError, match="must be an array, got None"):
        pz.PaperStage(FS).run(nothing)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({**UNITY, "estimator": "rls"}, "estimator must have step and model, got str"),
        (
            {**UNITY, "estimator": pz.HysteresisRLS},
            "must be an object, got the class: make one, as HysteresisR",
        ),
        ({"compensator": pz.InverseCompensator}, "compensator must be an object"),
        ({"controller": object()}, "controller must have step and learn"),
    ],
)
def test_what_is_no_part_of_a_loop_is_refused(parts: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        pz.track(WAVE, stage=pz.PaperStage(FS), **parts)


def test_errors_leave_out_missing_readings() -> None:
    readings = [0.0, 1.0, None, 0.5, None, None, None, None]
    stage = SimpleNamespace(step=lambda u: readings.pop(0))
    record = pz.track(pz.signals.Signal(np.zeros(8), sample_rate=8.0, period=4), stage=stage, **UNITY)
    assert record.max_error() == 1.0
    assert record.rms_error() == pytest.approx(np.sqrt(1.25 / 3.0))
    np.testing.assert_equal(record.max_error_per_period(), [1.0, np.nan])
    assert record.table().splitlines()[1].split() == ["1", "1.0000", "0.6455"]
    assert record.plot().axes


class Learner:
    """An estimator, or a controller, of one's own."""

    model = pz.LinearGain(1.0)

    def __init__(self) -> None:
        self.seen: list[Any] = []

    def step(self, r: float, x: float | None = None) -> float:
        self.seen.append(x)
        return r

    def learn(self, u: float, x: float | None) -> None:
        self.seen.append((u, x))


def test_ones_own_parts_are_told_of_no_measurement_by_none() -> None:
    odd: Any = SimpleNamespace(step=lambda u: ("late", [1.0], None, 0.5)[round(u)])
    record = pz.track(np.arange(4.0), stage=odd, **UNITY, sample_rate=100.0)
    np.testing.assert_array_equal(np.isfinite(record.measured), [False, True, False, True])
    deaf: Any = SimpleNamespace(sample_rate=100.0, step=lambda u: float("nan") if u > 0.0 else None)
    estimator, controller = Learner(), Learner()
    pz.track(WAVE, stage=deaf, **UNITY, estimator=estimator)
    assert estimator.seen == [None] * WAVE.size
    pz.track(WAVE, stage=deaf, controller=controller)
    assert controller.seen[1::2] == [(u, None) for u in WAVE]


@pytest.mark.parametrize(
    ("r", "words"),
    [([0.0, np.nan], "r holds 1 values that are NaN"), ([], "r needs at least 1 samples"),
     (np.repeat([0.0, 1.0, 0.0], 100), r"signals\.filtered_steps")],
)  # fmt: skip
def test_wrong_references(r: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        pz.track(r, stage=pz.PaperStage(), compensator=pz.InverseCompensator(START))


class Driver:
    """A stage of the user's own, by the same methods: the loop over it is Python's."""

    def __init__(self, stage: Any) -> None:
        self._stage = stage

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stage, name)


@pytest.mark.parametrize(
    ("model", "make"),
    [
        (START, lambda: pz.HysteresisRLS(FS, initial_model=START)),
        (START, lambda: pz.HysteresisRLS(FS, initial_model=START, memory=0.2, offset=False, delay=1.5)),
        (START, lambda: pz.HysteresisEKF(FS, initial_model=START, offset=True)),
        (LINE, lambda: pz.HysteresisRLS(FS, initial_model=pz.LinearGain(0.14, 0.2), memory=0.2)),
        (pz.ColemanHodgdon(0.05, 0.01, 0.0009), lambda: pz.HysteresisRLS(FS, policies=(), memory=0.001)),
    ],
)
@pytest.mark.parametrize("options", [{}, {"temperature": [[0.0, 20.0], [0.2, 60.0]], "seed": 3}])
@pytest.mark.slow_but_first
def test_the_compiled_ring_is_the_loop_over_its_parts(model: Any, make: Any, options: Any) -> None:
    r = pz.signals.triangle(5.0, 20.0, 3, FS)
    results = []
    for wrap in (lambda stage: stage, Driver):
        stage, estimator = pz.PaperStage(FS, **options), make()
        estimator.predict(0.1)
        compensator = pz.InverseCompensator(model, pz.VoltageLimits(-30.0, 30.0))
        for interval in (70, 7):
            parts: Any = {"compensator": compensator, "estimator": estimator, "update_interval": interval}
            record = pz.track(r, stage=wrap(stage), **parts)
        traces = record.voltage, record.measured, record.displacement, record.parameters
        moved = np.asarray(stage.displacement).tolist()
        found = estimator.to_dict(), compensator.model, compensator.status, stage.time, moved
        results.append((traces, found, record.parameter_names, compensator.step(1.0), stage.step(2.0)))
    for one, other in zip(results[0][0], results[1][0], strict=True):
        np.testing.assert_array_equal(one, other)
    assert results[0][1:] == results[1][1:]
