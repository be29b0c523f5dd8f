"""`warmup`: what a live loop will call is there before it runs."""

import pytest

import piezoest as pz
from piezoest.controller import kernel

LOOPS = (kernel.step, kernel.learn, kernel.run, kernel.learn_all)


@pytest.fixture
def nothing_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    for loop in LOOPS:
        monkeypatch.setattr(loop, "_entries", {})


@pytest.mark.usefixtures("nothing_loaded")
def test_the_class_stands_for_a_controller_of_any_rate_and_limits() -> None:
    assert pz.warmup(pz.AdaptiveFeedforward) > 0.0
    loaded = [dict(loop._entries) for loop in LOOPS]
    controller = pz.AdaptiveFeedforward(1234.0, limits=pz.VoltageLimits(-3.0, 7.0, 100.0, 1234.0))
    for loop, entries in zip(LOOPS, loaded, strict=True):
        assert list(entries) == list(loop._entries) == [controller.layouts]


def test_a_controller_is_left_as_it_is() -> None:
    controller = pz.AdaptiveFeedforward(1000.0, limits=pz.VoltageLimits(0.0, 100.0), estimators=())
    before = controller.to_dict()
    pz.warmup(controller)
    assert controller.to_dict() == before


def test_a_compensator_is_compiled_and_left_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    from piezoest.compensators import inverse_kernel

    for loop in (inverse_kernel.step, inverse_kernel.run):
        monkeypatch.setattr(loop, "_entries", {})
    model = pz.PrandtlIshlinskii(0.1, [1.0, 2.0, 3.0], [0.02, 0.01, 0.01])
    compensator = pz.InverseCompensator(model, sample_rate=1000.0)
    pz.warmup(compensator)
    assert compensator.status.samples == 0
    assert compensator.layouts in inverse_kernel.step._entries
    assert compensator.layouts in inverse_kernel.run._entries
