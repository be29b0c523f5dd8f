"""The admissible model that `HysteresisRLS` hands out, from its flat state."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from piezoest._checks import FloatArray
from piezoest._jit import PROPOSE_TYPES, compiled
from piezoest.equations import admissible
from piezoest.equations import coleman_hodgdon as equations
from piezoest.estimators import level
from piezoest.estimators import recursive_least_squares as law
from piezoest.estimators import rls_kernel as kernel

# The model handed out keeps this distance from the faces of the admissible set: parts of
# gamma.
MARGIN = 1e-3

# Terms of the model, fixed at construction: scales of up to four parameters, then the start's.
SCALE, GAIN, START_OFFSET, TERMS = 0, 4, 5, 6


def model_terms(scale: FloatArray, gain: float, offset: float) -> FloatArray:
    """What `proposed` needs beside state and configuration."""
    terms = np.zeros(TERMS)
    terms[: scale.size] = scale
    terms[GAIN], terms[START_OFFSET] = gain, offset
    return terms


@register_jitable
def is_admissible(theta: Any, terms: Any) -> Any:
    """1.0 if the Coleman-Hodgdon parameters theta need not be moved."""
    return admissible.is_admissible(
        theta[0], theta[1], theta[2], kernel.LEAST * terms[SCALE], kernel.LEAST * terms[SCALE + 1], MARGIN
    )


@register_jitable
def _start(theta: Any, terms: Any, n: Any) -> None:
    """The start's model, or the nearest to it: where the estimate has none."""
    for i in range(n):
        theta[i] = 0.0
    alpha, beta = terms[SCALE], terms[SCALE + 1]
    theta[0], theta[1] = alpha, beta
    area = alpha * beta
    theta[2] = min(max(terms[SCALE + 2], (1.0 + MARGIN) * area), (2.0 - MARGIN) * area)


@register_jitable
def proposed(state: Any, config: Any, terms: Any, model: Any) -> None:
    """(alpha, beta, gamma, offset) or (gain, -, -, offset) into `model`: theta or its nearest point."""
    n = int(config[kernel.N])
    head = kernel.FRONT + law.HEAD
    theta = np.empty(n)
    for i in range(n):
        theta[i] = state[head + i] * terms[SCALE + i]
    offset = terms[START_OFFSET]
    if config[kernel.HYSTERETIC] == 0.0:
        gain = admissible.kept_gain(theta[0], terms[GAIN], kernel.LEAST)
        if n == 2:
            offset = theta[1] + state[kernel.X_CENTRE] - gain * state[kernel.U_CENTRE]
        model[0] = gain
        model[3] = offset
        return
    if is_admissible(theta, terms) == 0.0:
        P = np.empty(n * n)
        for i in range(n):
            for j in range(n):
                P[i * n + j] = state[head + n + i * n + j] * (terms[SCALE + i] * terms[SCALE + j])
        if not admissible.project_admissible(
            theta, P, n, kernel.LEAST * terms[SCALE], kernel.LEAST * terms[SCALE + 1], MARGIN
        ):
            _start(theta, terms, n)
    for i in range(3):
        model[i] = theta[i]
    if n == 4:
        c = theta[2] / theta[0]
        centre = state[kernel.X_CENTRE] - c * state[kernel.U_CENTRE]
        offset = equations.offset_from_rate_parameters(theta[0], theta[3])
        trust = kernel.trust_in_levels(state, config)
        if trust > 0.0:
            levels = 0.0  # the start's, until a whole period is known
            if level.is_known(state[kernel.LEVEL : kernel.FRONT]):
                levels = level.offset(state[kernel.LEVEL : kernel.FRONT], c - theta[1], c)
            offset = offset + trust * (levels - offset)
        offset = offset + centre
    model[3] = offset


@compiled(PROPOSE_TYPES)
def propose(state: Any, config: Any, terms: Any, model: Any) -> None:
    """Compiled `proposed`."""
    proposed(state, config, terms, model)
