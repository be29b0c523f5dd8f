"""The compiled law of App. A: one sample (phi, z) of recursive least squares, with its policies.

Policies come in by their hooks, see `piezoest.policies.base`. State and settings of whoever has the law hold
it as ``law``, its policies as ``policies``, the regressor as ``phi``.
"""

from typing import Any

import numpy as np

from piezoest.compile import Record, compiled, inlined
from piezoest.equations import innovation_energy
from piezoest.equations import least_squares as equations
from piezoest.estimators.samples import HELD, MISSING, OUTCOME, UPDATED
from piezoest.layout import (
    ABSENT,
    AMOUNT,
    COUNT,
    COVARIANCE,
    FIXED,
    NUMBER,
    PARAMETER,
    WORK,
    Field,
    numbers,
    record,
)
from piezoest.policies import Policy
from piezoest.policies.base import Conditions, chain

# Beyond this a number is no measurement, and its square could overflow.
LARGEST = 1e100

prepare = chain("prepare")
permits = chain("permits")
before_update = chain("before_update")
after_update = chain("after_update")


def law_layout(n: int, *, discrete: bool) -> Field:
    """What the law keeps: outcome, estimate, and of the sample z, factor, noise, S of the gain, P phi."""
    rates = record(theta=numbers(n, kind=WORK), P=numbers(n, n, kind=WORK))
    return record(
        innovation=NUMBER, innovation_variance=AMOUNT, updates=COUNT, held=COUNT, resets=COUNT, last=OUTCOME,
        z=WORK, forgetting=WORK, noise=WORK, spread=WORK, product=numbers(n, kind=WORK),
        theta=numbers(n, kind=PARAMETER), P=numbers(n, n, kind=COVARIANCE),
        rates=ABSENT if discrete else rates,
    )  # fmt: skip


def law_settings_layout(n: int) -> Field:
    """What the law is given: forgetting factor, noise variance, bound on the trace, step, rate."""
    return record(
        forgetting=FIXED, noise=FIXED, bound=FIXED, step=FIXED, rate=FIXED, normalised=FIXED,
        P_0=numbers(n, n, kind=FIXED),
    )  # fmt: skip


def law_settings(policies: tuple[Policy, ...], at: Conditions, noise: float) -> dict[str, Any]:
    """Numbers of the law: without policies it forgets nothing and has no bound."""
    own = {"forgetting": 1.0, "rate": 0.0, "bound": np.inf, "normalised": 0.0}
    for policy in policies:
        own |= policy.law(at)
    return {**own, "noise": noise, "step": at.step, "P_0": at.P_0}


@inlined
def restart(law: Any, settings: Any) -> None:
    """Let P start again."""
    equations.restore_covariance(law.P, settings.P_0)
    law.resets += 1.0


@inlined
def _settle(law: Any, settings: Any, safe: Any, y: Any, S: Any) -> None:
    """Count a sample: an update, or one that was not safe; then theta stays and P starts again."""
    if safe:
        law.innovation = y
        law.innovation_variance = S
        law.updates += 1.0
        law.last = UPDATED
    else:
        law.last = HELD
        law.held += 1.0
        restart(law, settings)


@inlined
def _exponentially(law: Any, settings: Any, phi: Any) -> None:
    theta, P, product, forgetting, R = law.theta, law.P, law.product, law.forgetting, law.noise
    y, quadratic = equations.innovation(theta, P, phi, law.z, product)
    safe = equations.is_safe(P, y, quadratic + forgetting * R, product)
    S = R
    if safe:
        S = equations.discrete_correction(theta, P, y, quadratic, forgetting, R, settings.bound, product)
    law.spread = forgetting * S
    _settle(law, settings, safe, y, S)


@inlined
def _by_direction(law: Any, settings: Any, phi: Any) -> None:
    theta, P, product, R = law.theta, law.P, law.product, law.noise
    y, q = equations.innovation(theta, P, phi, law.z, product)
    safe = equations.is_safe(P, y, q + R, product)
    if safe:
        equations.directional_correction(theta, P, y, q, law.forgetting, R, settings.bound, product)
    law.spread = q + R
    _settle(law, settings, safe, y, q + R)


@inlined
def _continuously(law: Any, settings: Any, phi: Any) -> None:
    theta, P, h, rates = law.theta, law.P, settings.step, law.rates
    y, S = equations.continuous_step(theta, P, phi, law.z, h, settings.rate, settings.normalised, rates)
    safe = equations.continuous_is_safe(P, phi, y, S, h, rates)
    if safe:
        equations.continuous_correction(theta, P, h, settings.bound, rates)
    _settle(law, settings, safe, y, S)


@inlined
def begin(state: Any, settings: Any, z: Any) -> None:
    """Begin a sample with the output z, and let the policies prepare it."""
    law = state.law
    law.z = z
    law.forgetting = settings.law.forgetting
    law.noise = settings.law.noise
    prepare(state, settings)


@inlined
def adapt(state: Any, settings: Any) -> None:
    """One sample that is prepared: regressor and output into the estimate, if every policy permits it."""
    law = state.law
    if not permits(state, settings):
        law.last = HELD
        law.held += 1.0
        return
    before_update(state, settings)
    if law.rates is not None:
        _continuously(law, settings.law, state.phi)
    elif settings.policies.directional_forgetting is not None:
        _by_direction(law, settings.law, state.phi)
    else:
        _exponentially(law, settings.law, state.phi)
    if law.last == UPDATED:
        after_update(state, settings)
        if state.energy is not None:
            innovation_energy.learn(state.energy, law.innovation, law.innovation_variance, state.fraction)


def layout(n: int, policies: Field, *, discrete: bool) -> Any:
    """State of a `RecursiveLeastSquares`, which follows no voltage."""
    law = law_layout(n, discrete=discrete)
    return record(
        phi=numbers(n, kind=WORK), fraction=ABSENT, swing=ABSENT, energy=ABSENT, error_covariance=ABSENT,
        law=law, policies=policies,
    )  # fmt: skip


@compiled
def update(state: Record, settings: Record, z: float) -> None:
    """Update by one sample whose regressor is in ``state.phi``."""
    within = np.abs(z) < LARGEST
    for i in range(len(state.phi)):
        within = within and np.abs(state.phi[i]) < LARGEST
    if not within:
        state.law.last = MISSING
        return
    begin(state, settings, z)
    adapt(state, settings)
