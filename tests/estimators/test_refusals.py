"""Arguments that an estimator or a policy cannot use are refused by name, before a sample is taken."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import policies as p
from tests.estimators.shared import TRUE

RATE = 1000.0
LINE, WRONG = pz.LinearGain(0.1), pz.ColemanHodgdon(0.02, 0.12, 0.009)
ABSURD = [({"initial_model": pz.LinearGain(gain)}, "initial_model") for gain in (5e-324, 1e-90, 1e90, 1e308)]
U, X = np.linspace(0.0, 9.0, 50), np.linspace(0.0, 1.3, 50)

# Class, then options with words of the message.
OPTIONS: dict[Any, list[tuple[dict[str, Any], str]]] = {
    pz.HysteresisRLS: [
        ({"memory": -1.0}, "memory must be above zero"), ({"noise": 1e200}, "noise"),
        ({"memory": "foo"}, "memory must be .period., a number of seconds or None, got 'foo'"),
        ({"offset": "x"}, "offset must be True, False or None"), ({"delay": 1e9}, "delay must be at most"),
        ({"delay": "3"}, "delay must be one number, got '3'"),
        ({"time_base": "seconds"}, "time_base must be"), ({"policies": 3}, "policies must be a tuple"),
        ({"policies": (p.NormBound(), p.NormBound())}, "policies holds 2 of NormBound"),
        ({"policies": (p.RandomWalk(), p.PeriodicForgetting())}, "exclude each other"),
        ({"policies": (p.DirectionalForgetting(),), "memory": 0.4}, "exclude each other"),
        ({"policies": (p.RandomWalk(),), "memory": 0.4}, "goes with memory='period'"),
        *(({"policies": (each,), "memory": None, "time_base": "continuous"}, "discrete time") for each in
          (p.DirectionalForgetting(), p.ChangeDetection(), p.ExcitationGate(), p.AmplitudeMemory())),
        *(({"policies": (each,), "initial_model": LINE}, "goes with a ColemanHodgdon")
          for each in (p.Projection(), p.AmplitudeMemory())), *ABSURD,
    ],
    pz.HysteresisEKF: [
        ({"initial_model": WRONG}, "is not admissible: use nearest_admissible"),
        ({"uncertainty": 0.0}, "uncertainty must be above zero"),
        ({"drift": -1.0}, "drift must be zero or more"), *ABSURD,
    ],
    pz.OutputErrorRLS: [
        ({"span": 1.0}, "span"), ({"members": 2}, "members"), ({"policies": ()}, "RandomWalk"),
        ({"policies": (p.RandomWalk(), p.NormBound())}, "NormBound"),
        ({"members": 10**9}, "members must be a whole number from 3 to 1000"),
    ],
    pz.PrandtlIshlinskiiRLS: [
        ({"voltage_range": (3.0, 1.0)}, "voltage_range"), ({"creep": (0.0,)}, "creep"),
        ({"mechanics": 780.0}, "mechanics"), ({"initial_model": pz.LinearGain(-1.0)}, "initial_model"),
        ({"initial_model": pz.PrandtlIshlinskii(-0.1, [], [])}, "initial_model"),
        ({"thresholds": 10**9}, "thresholds must be a whole number from 0"),
        ({"thresholds": 200, "bends": 50}, "more than 1000: take fewer"),
    ],
    pz.MovingHorizon: [
        ({"window": 0.1, "hop": 0.1}, "hop must be shorter than the window"),
        ({"initial_model": WRONG}, "initial_model must be admissible"), ({"decimation": 0}, "decimation"),
        ({"window": 1e9}, "window must be at most"), *ABSURD,
    ],
    pz.BatchFit: [
        ({"method": "shooting"}, "method must be one of"), ({"loss": "absolute"}, "loss must be one of"),
        ({"creep": [0.1]}, "creep must be a Creep"), ({"hop": 1e29}, "hop must be at most"),
        ({"fixed": {"apha": 0.02}}, r"fixed holds unknown names \['apha'\]"),
        ({"fixed": {"alpha": 0.02, "beta": 0.1, "gamma": 1.0}}, "parameters are not admissible"),
        ({"fixed": {"beta": -0.1}}, "must be above zero"),
        ({"initial_model": LINE, "fixed": {"gain": 1.0}}, "nothing to fit"),
        ({"initial_model": pz.LinearGain(0.0)}, "gain of zero"), *ABSURD,
    ],
}  # fmt: skip
POLICIES: list[tuple[Any, dict[str, Any]]] = [
    (p.RandomWalk, {"memory": 0.0}), (p.OutlierRejection, {"warm_up": 0}), (p.NormBound, {"limit": 0.5}),
    (p.CovarianceResetting, {"floor": 1.0}), (p.DirectionalForgetting, {"unit": "minute"}),
    (p.VariableForgetting, {"shortest": 1.5}), (p.Projection, {"margin": 0.5}),
    (p.ChangeDetection, {"threshold": 0.0}), (p.ChangeDetection, {"drift": -1.0}),
    (p.ExcitationGate, {"least": 1.0}), (p.AmplitudeMemory, {"places": 10**9}),
    (p.AmplitudeMemory, {"tolerance": 0.0}), (p.AmplitudeMemory, {"uncertainty": -1.0}),
]  # fmt: skip
REMEMBERING: Any = {"policies": (p.RandomWalk(), p.AmplitudeMemory(places=1))}
PROFILE: Any = pz.AmplitudeProfile
CALLS: list[tuple[Any, str]] = [
    (lambda: pz.HysteresisRLS(RATE).profile, "needs policies"),
    (lambda: pz.HysteresisRLS(RATE, **REMEMBERING).profile.at(1.0), "empty"),
    (lambda: setattr(pz.HysteresisRLS(RATE, **REMEMBERING), "profile",
                     PROFILE([1.0, 2.0], [TRUE.theta] * 2)), "AmplitudeMemory has 1 places"),
    (lambda: PROFILE([2.0, 1.0], [TRUE.theta] * 2), "ascend"),
    (lambda: p.policy_from_dict({"policy": "Magic"}), "policy 'Magic' is unknown"),
    (lambda: pz.BatchFit(RATE).fit(U, X[:-1]), "u and x must have the same length, got 50 and 49"),
    (lambda: pz.BatchFit(RATE).fit(U[:3], X[:3]), r"x has 3 samples .* needs at least 5"),
    (lambda: pz.BatchFit(RATE).fit(np.ones(50), X), "u never changes"),
    (lambda: pz.EstimatorBank(pz.FilterPyEKF(RATE), 2), "list of estimators"),  # type: ignore[arg-type]
    (lambda: pz.EstimatorBank(pz.HysteresisRLS(RATE), 10**9), "channels must be a whole number from 1"),
    (lambda: pz.EstimatorBank(pz.HysteresisRLS(RATE), 2).step(np.zeros(3), np.zeros(2)),
     r"u must have shape \(2,\)"),
    (lambda: pz.EstimatorBank(pz.HysteresisRLS(RATE), 2).run(np.zeros((4, 2)), np.zeros(4)),
     r"x must have shape \(K, 2\)"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [(kind, options, message) for kind, cases in OPTIONS.items() for options, message in cases],
)
def test_options_that_cannot_be_used(kind: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        kind(RATE, **options)


@pytest.mark.parametrize(("kind", "options"), POLICIES)
def test_policies_that_cannot_be(kind: Any, options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(options))):
        kind(**options)


@pytest.mark.parametrize(("call", "message"), CALLS)
def test_calls_that_cannot_be(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
