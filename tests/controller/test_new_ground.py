"""References that leave what was seen before: wider legs, quick edges, and fast waves from the start on."""

import numpy as np
import pytest

import piezoest as pz
from piezoest._checks import FloatArray
from tests.controller.shared import drive, late

FS = 2000.0
LIMITS = pz.VoltageLimits(-150.0, 150.0)


class Plays:
    """A stage of a line and three plays: x = share u + plays [µm], or without loop where share is one."""

    def __init__(self, share: float) -> None:
        self.share, self.places = share, [0.0, 0.0, 0.0]

    def step(self, u: float) -> float:
        for i, width in enumerate((5.0, 15.0, 30.0)):
            self.places[i] = min(max(self.places[i], u - width), u + width)
        return 0.1 * (self.share * u + (1.0 - self.share) / 3.0 * sum(self.places))


def test_waves_of_seventy_times_the_amplitude_are_no_fault() -> None:
    r = np.concatenate((pz.signals.sine(0.1, 4.0, 20, FS).values, pz.signals.sine(7.0, 4.0, 12, FS).values))
    driver = pz.AdaptiveFeedforward(FS, limits=LIMITS)
    run = drive(driver, Plays(0.3), r)
    assert not [event.reason for event in driver.events if not event.reason.startswith("lag")]
    assert np.abs(r - run.x)[-2000:].max() < 0.5
    assert np.abs(run.u)[-2000:].max() < 110.0


@pytest.mark.parametrize("samples", [2, 4])
def test_quick_edges_with_late_readings_are_left_to_the_line(samples: int) -> None:
    edge = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 25))
    leg = np.concatenate((2.0 * edge - 1.0, np.ones(400)))
    r: FloatArray = 5.0 * np.tile(np.concatenate((leg, -leg)), 12)
    run = drive(pz.AdaptiveFeedforward(FS, limits=LIMITS), Plays(1.0), r, late(samples))
    # Of a stage without a loop the line knows all.
    assert np.abs(r - run.x)[-1700:].max() < 0.05


def test_a_reference_that_is_faster_than_the_start_is_caught() -> None:
    r = pz.signals.sine(8.0, 150.0, 40, 5.0 * FS).values
    run = drive(pz.AdaptiveFeedforward(5.0 * FS, limits=LIMITS), Plays(0.6), r)
    assert run.doing.index("running") < 1000
    assert np.abs(run.u).max() < 140.0


@pytest.mark.parametrize(("samples", "frequency", "soon"), [(5, 30.0, 80), (10, 20.0, 120), (10, 40.0, 120)])
def test_a_fast_reference_is_caught_with_late_readings(samples: int, frequency: float, soon: int) -> None:
    """The gain on the way there is that of the voltage that late readings answer."""
    r = 3.0 + pz.signals.sine(4.0, frequency, 40, 1000.0).values
    driver = pz.AdaptiveFeedforward(1000.0, limits=LIMITS, estimators=())
    run = drive(driver, Plays(1.0), r, late(samples))
    assert run.doing.index("running") < soon
    # The gain is 0.1 µm/V, and the first wave already misses little.
    assert np.abs(r - run.x)[soon : soon + 100].max() < 1.0


class Changing(Plays):
    """A stage whose gain changes by a factor after so many samples."""

    def __init__(self, share: float, factor: float, after: int) -> None:
        super().__init__(share)
        self.factor, self.left = factor, after

    def step(self, u: float) -> float:
        self.left -= 1
        return super().step(u) * (self.factor if self.left < 0 else 1.0)


@pytest.mark.parametrize(("share", "amplitude"), [(0.5, 1.0), (0.7, 1.0), (0.7, 4.0)])
def test_models_go_on_where_the_gain_changes(share: float, amplitude: float) -> None:
    r = pz.signals.sine(amplitude, 4.0, 14, FS).values
    run = drive(pz.AdaptiveFeedforward(FS, limits=LIMITS), Changing(share, 0.7, 5000), r)
    worst = np.abs(r - run.x).reshape(14, -1).max(axis=1) / amplitude
    # Back at the line, which knows the old gain, it is 0.3 of the amplitude.
    assert worst[10] < 0.2
    assert worst[12] < 0.03
