"""Arguments that an estimator or a policy cannot use are refused by name, before a sample is taken."""

from typing import Any

import numpy as np
import pytest

import piezoest as pz
from piezoest import policies as p

RATE = 1000.0
LINE, PLAYS = pz.LinearGain(0.1), pz.PrandtlIshlinskii(-0.1, [], [])
LOOP, WRONG = pz.ColemanHodgdon(0.021, 0.147, 0.00429), pz.ColemanHodgdon(0.02, 0.12, 0.009)
U, X = np.linspace(0.0, 9.0, 50), np.linspace(0.0, 1.3, 50)

# Class, options, words of the message.
OPTIONS: list[tuple[Any, dict[str, Any], str]] = [
    (pz.HysteresisRLS, {"memory": -1.0}, "memory must be above zero"),
    (pz.HysteresisRLS, {"memory": "foo"}, "memory must be .period., a number of seconds or None, got 'foo'"),
    (pz.HysteresisRLS, {"noise": 1e200}, "noise"),
    (pz.HysteresisRLS, {"time_base": "seconds"}, "time_base must be"),
    (pz.HysteresisRLS, {"offset": "x"}, "offset must be True, False or None"),
    (pz.HysteresisRLS, {"policies": 3}, "policies must be a tuple"),
    (pz.HysteresisRLS, {"policies": (p.NormBound(), p.NormBound())}, "policies holds 2 of NormBound"),
    (pz.HysteresisEKF, {"initial_model": WRONG}, "is not admissible: use nearest_admissible"),
    (pz.HysteresisEKF, {"uncertainty": 0.0}, "uncertainty must be above zero"),
    (pz.HysteresisEKF, {"drift": -1.0}, "drift must be zero or more"),
    (pz.OutputErrorRLS, {"span": 1.0}, "span"),
    (pz.OutputErrorRLS, {"members": 2}, "members"),
    (pz.OutputErrorRLS, {"policies": ()}, "RandomWalk"),
    (pz.OutputErrorRLS, {"policies": (p.RandomWalk(), p.NormBound())}, "NormBound"),
    (pz.PrandtlIshlinskiiRLS, {"voltage_range": (3.0, 1.0)}, "voltage_range"),
    (pz.PrandtlIshlinskiiRLS, {"creep": (0.0,)}, "creep"),
    (pz.PrandtlIshlinskiiRLS, {"mechanics": 780.0}, "mechanics"),
    (pz.PrandtlIshlinskiiRLS, {"initial_model": pz.LinearGain(-1.0)}, "initial_model"),
    (pz.PrandtlIshlinskiiRLS, {"initial_model": PLAYS}, "initial_model"),
    (pz.MovingHorizon, {"window": 0.1, "hop": 0.1}, "hop must be shorter than the window"),
    (pz.MovingHorizon, {"initial_model": WRONG}, "initial_model must be admissible"),
    (pz.MovingHorizon, {"decimation": 0}, "decimation"),
    (pz.BatchFit, {"method": "shooting"}, "method must be one of"),
    (pz.BatchFit, {"loss": "absolute"}, "loss must be one of"),
    (pz.BatchFit, {"creep": [0.1]}, "creep must be a Creep"),
    (pz.BatchFit, {"fixed": {"apha": 0.02}}, r"fixed holds unknown names \['apha'\]"),
    (pz.BatchFit, {"fixed": {"alpha": 0.02, "beta": 0.1, "gamma": 1.0}}, "parameters are not admissible"),
    (pz.BatchFit, {"fixed": {"beta": -0.1}}, "must be above zero"),
    (pz.BatchFit, {"initial_model": LINE, "fixed": {"gain": 1.0}}, "nothing to fit"),
    (pz.BatchFit, {"initial_model": pz.LinearGain(0.0)}, "gain of zero"),
    # What becomes a size is bounded.
    (pz.HysteresisRLS, {"delay": 1e9}, "delay must be at most"),
    (pz.OutputErrorRLS, {"members": 10**9}, "members must be a whole number from 3 to 1000"),
    (pz.PrandtlIshlinskiiRLS, {"thresholds": 10**9}, "thresholds must be a whole number from 0"),
    (pz.PrandtlIshlinskiiRLS, {"thresholds": 200, "bends": 50}, "more than 1000: take fewer"),
    (pz.MovingHorizon, {"window": 1e9}, "window must be at most"),
    (pz.BatchFit, {"hop": 1e29}, "hop must be at most"),
    # Policies that do not go together, or not with the estimator.
    (pz.HysteresisRLS, {"policies": (p.RandomWalk(), p.PeriodicForgetting())}, "exclude each other"),
    (pz.HysteresisRLS, {"policies": (p.DirectionalForgetting(),), "memory": 0.4}, "exclude each other"),
    (pz.HysteresisRLS, {"policies": (p.RandomWalk(),), "memory": 0.4}, "goes with memory='period'"),
    *((pz.HysteresisRLS, {"policies": (each,), "memory": None, "time_base": "continuous"}, "discrete time")
      for each in (p.DirectionalForgetting(), p.ChangeDetection(), p.ExcitationGate(), p.AmplitudeMemory())),
    *((pz.HysteresisRLS, {"policies": (policy,), "initial_model": LINE}, "goes with a ColemanHodgdon")
      for policy in (p.Projection(), p.AmplitudeMemory())),
    *((kind, {"initial_model": pz.LinearGain(gain)}, "initial_model") for gain in (5e-324, 1e-90, 1e90, 1e308)
      for kind in (pz.HysteresisRLS, pz.HysteresisEKF, pz.MovingHorizon, pz.BatchFit)),
]  # fmt: skip
POLICIES: list[tuple[Any, dict[str, Any]]] = [
    (p.RandomWalk, {"memory": 0.0}),
    (p.OutlierRejection, {"warm_up": 0}),
    (p.NormBound, {"limit": 0.5}),
    (p.CovarianceResetting, {"floor": 1.0}),
    (p.DirectionalForgetting, {"unit": "minute"}),
    (p.VariableForgetting, {"shortest": 1.5}),
    (p.Projection, {"margin": 0.5}),
    (p.ChangeDetection, {"threshold": 0.0}),
    (p.ChangeDetection, {"drift": -1.0}),
    (p.ExcitationGate, {"least": 1.0}),
    (p.AmplitudeMemory, {"places": 10**9}),
    (p.AmplitudeMemory, {"tolerance": 0.0}),
    (p.AmplitudeMemory, {"uncertainty": -1.0}),
]
REMEMBERING: Any = {"policies": (p.RandomWalk(), p.AmplitudeMemory(places=1))}
PROFILE: Any = pz.AmplitudeProfile
CALLS: list[tuple[Any, str]] = [
    (lambda: pz.HysteresisRLS(RATE).profile, "needs policies"),
    (lambda: pz.HysteresisRLS(RATE, **REMEMBERING).profile.at(1.0), "empty"),
    (lambda: setattr(pz.HysteresisRLS(RATE, **REMEMBERING), "profile",
                     PROFILE([1.0, 2.0], [LOOP.theta] * 2)), "AmplitudeMemory has 1 places"),
    (lambda: PROFILE([2.0, 1.0], [LOOP.theta] * 2), "ascend"),
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


@pytest.mark.parametrize(("kind", "options", "message"), OPTIONS)
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
