"""What estimators whose samples go through compiled functions share."""

from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from piezoest._checks import FloatArray
from piezoest.equations import swing
from piezoest.estimators import loops, saved_state
from piezoest.estimators.base import EstimatorBase, Trace
from piezoest.estimators.saved_state import Rule
from piezoest.layout import ABSENT, Named, Record, new

# Where a law keeps its outcome.
IN_LAW: dict[str, tuple[str, ...]] = {
    "y": ("law", "innovation"),
    "S": ("law", "innovation_variance"),
    "P": ("law", "P"),
}
# Histories that a compiled loop does not write.
NONE, NO_ROWS = np.empty(0), np.empty((0, 0))


class CompiledEstimator(EstimatorBase):
    """An estimator whose samples go through compiled functions on named numbers.

    Its `kernel` is a module, named by the layout of the state, with functions that compiled code can call:
    ``sample(state, settings, u, x)``, what becomes of one sample; ``write_row(state, settings, row)``, what a
    `run` keeps of the estimate after it, and ``outcome(state)``, innovation, its variance and covariance;
    ``proposed(state, settings, model)``, the admissible model as known now: gain, or alpha, beta and gamma,
    and fourth the offset. A class that has `model` itself does without the last, and cannot be exported to C.
    """

    __slots__ = ("_run_loop", "_settings", "_settings_layout", "_step_loop")

    #: Module with the compiled functions.
    kernel: ClassVar[Any]
    #: Functions within ``kernel.sample`` that no model depends on: a controller leaves them out.
    unneeded: ClassVar[tuple[Any, ...]] = ()

    _machine_code: ClassVar[tuple[str, ...]] = ("_step_loop", "_run_loop")
    _places: ClassVar[dict[str, tuple[str, ...]]] = {"P": ("law", "P")}

    _settings_layout: Record
    _settings: Any
    _step_loop: Any
    _run_loop: Any

    def _configure(self, layout: Record, values: dict[str, Any]) -> None:
        """Keep what compiled code is given beside the state: settings that no sample changes."""
        self._settings_layout = layout
        self._settings = new(layout, **values)
        self._step_loop = self._run_loop = None

    @property
    def settings(self) -> Any:
        """What compiled code is given beside `state`, by name: a NumPy structured array."""
        return self._settings

    @property
    def layouts(self) -> tuple[Record, Record]:
        """Layouts of `state` and `settings`, for which the compiled functions are made."""
        return self._layout, self._settings_layout

    def _rules(self, state: Any) -> Iterable[Rule]:
        counts = self._counts(state)
        skipped = (counts[name] for name in ("missing", "outliers", "updates", "held"))
        yield saved_state.no_more_than(counts["samples"], *skipped)
        if self._layout.by_name.get("swing", ABSENT) != ABSENT:
            yield swing.has_a_size(state["swing"])

    def _sample(self, u: float, x: float) -> None:
        if self._step_loop is None:
            self._step_loop = loops.step.of(*self.layouts)
        self._step_loop(self._state, self._settings, u, x)

    def _through(self, u: FloatArray, x: FloatArray, every: int, histories: tuple[FloatArray, ...]) -> None:
        """Run checked records; every k-th sample goes into those histories that have room."""
        if self._run_loop is None:
            self._run_loop = loops.run.of(*self.layouts)
        self._run_loop(self._state, self._settings, u, x, every, *histories)

    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        rows, n = u.size // every, len(super()._now("P"))
        theta = np.empty((rows, self.row_size))
        sizes = {name: rows if name in want else 0 for name in ("y", "S", "P")}
        y, S, P = np.empty(sizes["y"]), np.empty(sizes["S"]), np.empty((sizes["P"], n * n))
        self._through(u, x, every, (theta, y, S, P))
        kept = {"y": y, "S": S, "P": P.reshape(-1, n, n)}
        return Trace(
            index=np.arange(every - 1, rows * every, every),
            theta=self.theta_of(theta),
            parameter_names=self.parameter_names,
            **{name: self._shown(name, kept[name], theta) for name in want},
        )

    def absorb(self, u: FloatArray, x: FloatArray) -> None:
        """Do the same as `run`, but keep nothing."""
        u, x = self._records(u, x)
        self._through(u, x, u.size + 1, (NO_ROWS, NONE, NONE, NO_ROWS))

    def _shown(self, name: str, values: FloatArray, rows: FloatArray) -> Any:
        """What is shown of y (…), S (…) or P (…, n, n), as the kernel has it, beside rows of the estimate."""
        return values

    def _now(self, name: str) -> Any:
        if name == "theta":
            return self.theta_of(self._row)
        return self._shown(name, super()._now(name), self._row if name == "P" else NONE)

    @property
    def _row(self) -> FloatArray:
        """What ``kernel.write_row`` writes now: so many numbers as there are parameters, if not said else."""
        row = np.empty(len(self.parameter_names))
        state, settings = Named(self._state, self._layout), Named(self._settings, self._settings_layout)
        self.kernel.write_row(state, settings, row)
        return row

    @property
    def row_size(self) -> int:
        """Numbers that compiled loops write into a row of their history of the estimate."""
        return int(self._row.size)

    def theta_of(self, rows: FloatArray) -> FloatArray:
        """Parameters (…, n) of rows (…, row_size) of that history, as ``kernel.write_row`` wrote them."""
        return rows

    @property
    def model(self) -> Any:
        """Admissible model as known now: `theta` itself, or its nearest point in the metric of P."""
        values, kind = np.zeros(4), type(self._initial)
        loops.propose.of(*self.layouts)(self._state, self._settings, values)
        numbers = values.tolist()
        return kind(*numbers[: len(kind.parameter_names)], numbers[3])


class Freezable(CompiledEstimator):
    """An estimator whose estimate can be held, by the flag ``frozen`` in its state."""

    __slots__ = ()

    @property
    def frozen(self) -> bool:
        """Whether the estimate is held; settable. Samples are then counted as held."""
        return bool(self._state["frozen"])

    @frozen.setter
    def frozen(self, frozen: bool) -> None:
        self._state["frozen"] = bool(frozen)
