"""Equations as CasADi expressions: their derivatives, and the simulation of a whole record."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import casadi
import numpy as np

from piezoest._checks import FloatArray
from piezoest.equations.creep import creep_step

# NumPy's functions on SX then give SX, which is what the equations rely on.
casadi.GlobalOptions.setNumpyMode(1)

# Samples traced into one straight-line function, and copies of it chained by mapaccum: CasADi's
# cost of a call, as large as that of ten samples, is then paid once in so many.
UNROLLED, CHAINED = 50, 20


def trace(function: Callable[..., Any], *sizes: int) -> Any:
    """CasADi Function of an equation."""
    arguments = [casadi.SX.sym(f"v{i}", max(size, 1)) for i, size in enumerate(sizes)]
    # An equation may write into its arrays, and knows their length: they are lists.
    results = function(
        *(casadi.vertsplit(v) if size else v for v, size in zip(arguments, sizes, strict=True))
    )
    results = results if isinstance(results, tuple) else (results,)
    return casadi.Function("traced", arguments, [casadi.vertcat(*results)], {"cse": True})


def jacobian(function: Callable[..., Any], *sizes: int) -> Callable[..., FloatArray]:
    """Exact derivative of an equation with respect to all of its arguments."""
    traced = trace(function, *sizes)
    symbols = traced.sx_in()
    derivative = casadi.jacobian(traced(*symbols), casadi.vertcat(*symbols))
    compiled = casadi.Function("derivative", symbols, [derivative], {"cse": True})
    return lambda *values: compiled(*values).full()


class Pass(NamedTuple):
    """One simulation of a record, with its derivatives by (parameters, start state).

    x (N,) [µm]; jacobian (N, n_p + n_s); end (n_s,), the state after the last sample; end_jacobian (n_s, n_p
    + n_s). Without sensitivities the Jacobians have no columns.
    """

    x: FloatArray
    jacobian: FloatArray
    end: FloatArray
    end_jacobian: FloatArray


class Simulation:
    """Output of a stage and its sensitivities, in one pass over a record.

    x = w + creep + offset, where w is the model's and drives the creep. Parameters
    p = (the model's constants..., offset, gains..., delay), state s = (the model's..., z...). The
    forward sensitivities ds/dp and ds/ds(0) are carried along as further states.

    `constants`: number of constants that its equation has. `delayed`: whether the derivative by a delay of
    the voltage is wanted too: the last of the parameters then, whose value is 0, for the voltage comes
    delayed.
    """

    __slots__ = ("_carried", "_delayed", "_model", "_plain", "_sensitive", "_sizes", "n_p", "n_s")

    def __init__(self, model: Any, constants: int, creep_terms: int, delayed: bool) -> None:
        self._model, self._delayed = model, delayed
        self._sizes = constants, len(model.state_names), creep_terms
        # A simulation has a state, though it may be one that stays as it is.
        self.n_p = constants + 1 + creep_terms + delayed
        self.n_s = max(1, len(model.state_names) + creep_terms)
        self._plain = _lengthened(self._step(sensitive=False))
        self._sensitive = _lengthened(self._step(sensitive=True))

    def _equations(self, s: Any, u: Any, p: Any, decays: Any) -> tuple[Any, Any]:
        """State and output after the voltage has gone from u[0] to u[1]; its slopes by the delay follow."""
        constants, states, terms = self._sizes
        if self._delayed:
            u = u[:2] + p[-1] * u[2:]
        own, w = self._model.free_step(s[:states], u[0], u[1], p[:constants])
        if terms == 0:
            return casadi.vertcat(*own) if own else s, w + p[constants]
        z = casadi.vertsplit(s[states:])
        gains = p[constants + 1 : constants + 1 + terms]
        x = w + creep_step(z, w, gains, decays) + p[constants]
        return casadi.vertcat(*own, *z), x

    def _step(self, sensitive: bool) -> Any:
        """One sample as a Function (state, voltages, constants) -> (state, outputs)."""
        n_p, n_s = self.n_p, self.n_s
        s, u = casadi.SX.sym("s", n_s), casadi.SX.sym("u", 4 if self._delayed else 2)
        p, decays = casadi.SX.sym("p", n_p), casadi.SX.sym("d", self._sizes[2])
        constants = casadi.vertcat(p, decays)
        s_next, x = self._equations(s, u, p, decays)
        if not sensitive:
            return casadi.Function("step", [s, u, constants], [s_next, x], {"cse": True})
        by_p = casadi.jacobian(s_next, p)
        # Parameters that never reach the state (the offset; c without creep) carry no sensitivity.
        pattern = np.array(by_p.sparsity().get_col())
        reaching = np.unique(pattern) if pattern.size else np.empty(0, dtype=int)
        self._carried = np.concatenate([reaching, n_p + np.arange(n_s)]).astype(int)
        width = self._carried.size
        S = casadi.SX.sym("S", n_s, width)
        direct = casadi.horzcat(by_p[:, reaching.tolist()], casadi.SX.zeros(n_s, n_s))
        by_s = casadi.jacobian(s_next, s)
        S_next = casadi.densify(casadi.mtimes(by_s, S) + direct)
        row = casadi.horzcat(casadi.jacobian(x, p), casadi.SX.zeros(1, n_s))
        row[:, self._carried.tolist()] += casadi.mtimes(casadi.jacobian(x, s), S)
        outputs = casadi.densify(casadi.vertcat(x, row.T))
        state = casadi.vertcat(s, casadi.vec(S))
        following = casadi.vertcat(s_next, casadi.vec(S_next))
        return casadi.Function("step", [state, u, constants], [following, outputs], {"cse": True})

    def run(
        self,
        u: FloatArray,
        p: FloatArray,
        s: FloatArray,
        decays: FloatArray,
        *,
        slope: FloatArray | None = None,
        before: float | None = None,
        sensitive: bool = True,
    ) -> Pass:
        """Simulate a record.

        `u` (N,): voltage [V]. `p` (n_p,): (constants..., offset, gains..., delay). `s` (n_s,): state before
        the first sample. `decays` (creep terms,): exp(-dt/tau_i). `slope` (N,): derivative of the voltage by
        the delay, where that is a parameter [V]. `before`: voltage before the first sample [V]; default u[0].
        `sensitive`: whether to carry the sensitivities along.
        """
        N, n_p, n_s = u.size, self.n_p, self.n_s
        columns = [np.append(u[:1] if before is None else before, u[:-1]), u]
        if slope is not None:
            columns += [np.append(slope[:1], slope[:-1]), slope]
        voltages = np.column_stack(columns)
        state = np.array(s, dtype=np.float64)
        if sensitive:
            start = np.zeros((self._carried.size, n_s))
            start[-n_s:] = np.eye(n_s)
            state = np.concatenate([state, start.ravel()])
        functions = self._sensitive if sensitive else self._plain
        outputs = np.empty((N, 1 + n_p + n_s if sensitive else 1))
        _drive(functions, state, voltages, np.concatenate([p, decays]), outputs)
        if not sensitive:
            return Pass(outputs[:, 0], outputs[:, 1:], state, np.empty((n_s, 0)))
        end_jacobian = np.zeros((n_s, n_p + n_s))
        end_jacobian[:, self._carried] = state[n_s:].reshape(-1, n_s).T
        return Pass(outputs[:, 0], outputs[:, 1:], state[:n_s], end_jacobian)


def _lengthened(step: Any) -> list[tuple[int, Any]]:
    """The step for 1000, 50 and 1 samples, longest first."""
    n, v, m = (step.size1_in(i) for i in range(3))
    state, u = casadi.SX.sym("s", n), casadi.SX.sym("u", v, UNROLLED)
    constants = casadi.SX.sym("c", m)
    now, rows = state, []
    for k in range(UNROLLED):
        now, row = step(now, u[:, k], constants)
        rows.append(row)
    several = casadi.Function("several", [state, u, constants], [now, casadi.horzcat(*rows)], {"cse": True})
    many = several.mapaccum("many", CHAINED)
    s, c = casadi.MX.sym("s", n), casadi.MX.sym("c", m)
    U = casadi.MX.sym("u", v, UNROLLED * CHAINED)
    states, outputs = many(s, U, casadi.repmat(c, 1, CHAINED))
    block = casadi.Function("block", [s, U, c], [states[:, -1], outputs])
    return [(UNROLLED * CHAINED, block), (UNROLLED, several), (1, step)]


def _drive(
    functions: list[tuple[int, Any]],
    state: FloatArray,
    voltages: FloatArray,
    constants: FloatArray,
    outputs: FloatArray,
) -> None:
    """Run through a record, `state` updated in place, by buffers: no CasADi matrix is made."""
    done, after = 0, np.empty_like(state)
    for length, function in functions:
        if voltages.shape[0] - done < length:
            continue
        buffer, evaluate = function.buffer()
        buffer.set_arg(0, state.data)
        buffer.set_arg(2, constants.data)
        buffer.set_res(0, after.data)
        while voltages.shape[0] - done >= length:
            buffer.set_arg(1, voltages[done : done + length].data)
            buffer.set_res(1, outputs[done : done + length].data)
            evaluate()
            state[:] = after
            done += length


@lru_cache(maxsize=16)
def simulation(model: Any, constants: int, creep_terms: int = 0, delayed: bool = False) -> Simulation:
    """`Simulation` of these arguments; made once."""
    return Simulation(model, constants, creep_terms, delayed)
