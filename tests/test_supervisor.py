"""The supervisor: adaptation that misbehaves is caught, and tried again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import piezoest as pz

FS = 20_000.0
START = pz.ColemanHodgdon(0.02, 0.12, 0.0036)
R = pz.signals.triangle(5.0, 5.0, 12, FS)


def ring(estimator: Any, supervisor: Any = None) -> Any:
    return pz.track(
        R,
        stage=pz.PaperStage(sample_rate=FS, seed=0),
        compensator=pz.InverseCompensator(START, pz.VoltageLimits(-100.0, 100.0)),
        estimator=estimator,
        update_interval=20,
        supervisor=supervisor,
    )


class Wild:
    """Learns well for five periods, then hands out nonsense for two."""

    def __init__(self) -> None:
        self._inner = pz.HysteresisRLS(FS)
        self._samples = 0

    def run(self, u: Any, x: Any) -> None:
        self._samples += len(u)
        self._inner.run(u, x)

    def step(self, u: float, x: float | None) -> None:
        self.run(np.array([u]), np.array([np.nan if x is None else x]))

    @property
    def model(self) -> Any:
        if 5 < self._samples / (FS / 5.0) < 7:
            return pz.ColemanHodgdon(0.2, 0.06, 0.02)
        return self._inner.model


def test_leaves_a_good_estimator_alone() -> None:
    supervisor = pz.Supervisor(FS)
    plain, guarded = ring(pz.HysteresisRLS(FS)), ring(pz.HysteresisRLS(FS), supervisor)
    assert guarded.max_error(last_periods=2) == pytest.approx(plain.max_error(last_periods=2), rel=0.05)
    assert guarded.max_error_per_period()[1:].max() < 1.1 * plain.max_error_per_period()[1:].max()
    assert not supervisor.holding


def test_leaves_a_model_of_another_kind_alone() -> None:
    supervisor = pz.Supervisor(FS)
    guarded = ring(pz.PrandtlIshlinskiiRLS(FS), supervisor)
    assert guarded.max_error(last_periods=2) < 0.02
    assert not supervisor.holding


def test_keeps_nonsense_away_from_the_stage() -> None:
    supervisor = pz.Supervisor(FS)
    plain, guarded = ring(Wild()), ring(Wild(), supervisor)
    linear = 0.55
    assert plain.max_error_per_period()[5:7].max() > 1.5 * linear
    assert guarded.max_error_per_period()[1:].max() < linear
    assert guarded.max_error_per_period()[-1] < 0.05
    times = [event.time for event in supervisor.events if event.action in ("kept", "fell back")]
    assert any(1.0 < time < 1.4 for time in times)
    assert "a line" in supervisor.events[0].reason


def test_falls_back_to_a_line_and_stays_there() -> None:
    class WrongLoop:
        """The right gain, with a loop three times too wide."""

        model = pz.ColemanHodgdon.from_loop(0.021, 0.147, 0.295)

        def step(self, u: float, x: float | None) -> None:
            pass

    supervisor = pz.Supervisor(FS)
    plain, guarded = ring(WrongLoop()), ring(WrongLoop(), supervisor)
    assert plain.max_error_per_period()[2:].min() > 0.55 * 1.2
    assert [event.action for event in supervisor.events] == ["fell back"]
    assert supervisor.holding
    assert guarded.max_error_per_period()[2:].max() < 1.2 * 0.55
    supervisor.reset()
    assert supervisor.events == ()


def test_short_memory_is_guarded() -> None:
    """Exponential forgetting over twenty samples runs away; with the guard it does not stay away."""
    estimators = [pz.HysteresisRLS(FS, memory=0.001) for _ in range(2)]
    plain, guarded = ring(estimators[0]), ring(estimators[1], pz.Supervisor(FS))
    assert guarded.rms_error() < 0.5 * plain.rms_error()
    assert np.median(guarded.max_error_per_period()[1:]) < 1.2 * 0.55


def test_wrong_arguments() -> None:
    with pytest.raises(ValueError, match="window must be above zero"):
        pz.Supervisor(FS, window=0.0)
    with pytest.raises(ValueError, match="limit must be above zero"):
        pz.Supervisor(FS, limit=-1.0)
