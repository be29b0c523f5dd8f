"""`warmup`: what a live loop will call is there before it runs."""

from typing import Any

import pytest

import piezoest as pz
from piezoest.compensators import inverse_kernel
from piezoest.controller import kernel

LOOPS = (kernel.step, kernel.learn, kernel.run, kernel.learn_all)


def forget(monkeypatch: pytest.MonkeyPatch, *loops: Any) -> None:
    for loop in loops:
        monkeypatch.setattr(loop, "_entries", {})


def test_the_class_stands_for_a_controller_of_any_rate_and_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    forget(monkeypatch, *LOOPS)
    assert pz.warmup(pz.AdaptiveFeedforward) > 0.0
    loaded = [list(loop._entries) for loop in LOOPS]
    controller = pz.AdaptiveFeedforward(1234.0, limits=pz.VoltageLimits(-3.0, 7.0, 100.0, 1234.0))
    assert loaded == [[controller.layouts]] * len(LOOPS)


def test_what_is_warmed_up_is_left_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    controller = pz.AdaptiveFeedforward(1000.0, limits=pz.VoltageLimits(0.0, 100.0), estimators=())
    before = controller.to_dict()
    pz.warmup(controller)
    assert controller.to_dict() == before
    forget(monkeypatch, inverse_kernel.step, inverse_kernel.run)
    model = pz.PrandtlIshlinskii(0.1, [1.0, 2.0, 3.0], [0.02, 0.01, 0.01])
    compensator = pz.InverseCompensator(model, sample_rate=1000.0)
    pz.warmup(compensator)
    assert compensator.status.samples == 0
    assert compensator.layouts in inverse_kernel.step._entries
    assert compensator.layouts in inverse_kernel.run._entries
