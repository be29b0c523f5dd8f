"""The compiled loops over samples, for every estimator: what one sample does is in its kernel.

The state's layout names the kernel, see `piezoest.estimators.compiled`.
"""

from piezoest.compile import Cube, Matrix, Record, Vector, compiled, nth
from piezoest.estimators.samples import keep_outcome


@compiled
def step(state: Record, settings: Record, u: float, x: float) -> None:
    """One sample."""
    state.sample(state, settings, u, x)


@compiled
def run(
    state: Record, settings: Record, u: Vector, x: Vector, every: int,
    rows: Matrix, y: Vector, S: Vector, P: Matrix,
) -> None:  # fmt: skip
    """Records; every `every`-th sample goes into the histories that have room."""
    row, due = 0, every
    for k in range(u.size):
        state.sample(state, settings, u[k], x[k])
        due -= 1
        if due == 0:
            state.write_row(state, settings, rows[row])
            innovation, variance, covariance = state.outcome(state)
            keep_outcome(row, innovation, variance, covariance, y, S, P)
            row, due = row + 1, every


@compiled
def step_channels(
    states: Record, settings: Record, u: Matrix, x: Matrix, first: int, stop: int, every: int, rows: Cube
) -> None:
    """Records (K, N) of the channels from `first` to `stop`, each with a state of its own."""
    for c in range(first, stop):
        state = nth(states, c)
        row, due = 0, every
        for k in range(u.shape[0]):
            state.sample(state, settings, u[k, c], x[k, c])
            due -= 1
            if due == 0:
                state.write_row(state, settings, rows[row, c])
                row, due = row + 1, every


@compiled
def propose(state: Record, settings: Record, model: Vector) -> None:
    """The admissible model as known now."""
    state.proposed(state, settings, model)
