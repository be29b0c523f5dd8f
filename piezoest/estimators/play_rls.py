"""Recursive least squares of a Prandtl-Ishlinskii model with creep and asymmetry."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from piezoest._checks import FloatArray, array_1d, integer, moderate
from piezoest.estimators import play_rls_kernel as kernel
from piezoest.estimators import play_rls_layout as layout
from piezoest.estimators import play_rls_settings as settings
from piezoest.estimators import state_tables
from piezoest.estimators.base import NO_ROWS, Freezable, Status, Trace
from piezoest.estimators.delay_line import delay_line
from piezoest.estimators.saved_state import Table
from piezoest.models import (
    ColemanHodgdon,
    Creep,
    LinearGain,
    MassSpringDamper,
    Model,
    PrandtlIshlinskii,
)

# Most of each: an update costs the square of the parameters, and so does their memory.
MOST_THRESHOLDS, MOST_BENDS, MOST_PARAMETERS = 200, 50, 1000


class PrandtlIshlinskiiRLS(Freezable):
    """Recursive least squares of a Prandtl-Ishlinskii model with creep, asymmetry and offset.

    x = K u + sum_i rho_i play_i(u) + sum_j c_j creep_j + level is linear in its parameters, with
    regressors from the voltage alone: no derivative of x is taken, minor loops are part of
    the model, and one set of parameters serves all amplitudes.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    initial_model : PrandtlIshlinskii, ColemanHodgdon or LinearGain, optional
        Model to start from. A `PrandtlIshlinskii` also brings thresholds, bends and time
        constants of creep, which are then kept. A `ColemanHodgdon` (default
        ``ColemanHodgdon(0.02, 0.12, 0.0036)``) is turned into weights that have its loop. A
        `LinearGain` stands for itself: the gain alone is estimated.
    voltage_range : tuple of float, optional
        Least and largest voltage [V]. Default: learnt. The grid then grows with the voltage,
        and once shrinks to it if after four turns it was laid too wide.
    thresholds : int
        Number n of plays, up to 200. Rule: the i-th threshold is i/n of half the voltage range.
    bends : int
        Number k of voltages at which slopes may change, up to 50, evenly over the range; 0 for a
        symmetric loop.
    creep : tuple of float
        Time constants of creep [s]; empty for none.
    uncertainty : float
        Standard deviation of the start's scale, in parts of itself; what is uncertain within is
        the shape of the loop.
    noise : float
        Standard deviation of the displacement's noise [µm].
    delay : float
        Samples by which the measured displacement lags the voltage, up to a million; may be fractional.
    mechanics : MassSpringDamper, optional
        Resonance that the voltage goes through before it is compared, so that it is not learnt
        as hysteresis: for references that reach towards it, with a `LeadFilter`.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    The law is a Kalman filter whose parameters walk, and it counts by the travel of the voltage
    and not by time. Samples are averaged until the voltage has travelled 1/32 of half
    the range; then one update is made. Each parameter's variance grows by the travel of its own
    regressor, up to its start: a weight whose play does not move is not forgotten. A level
    walks fast along with them and takes what changes slowly and is no parameter's. At a dwell only
    the level moves. `theta` holds slopes and creep gains; in `model` they are zero or more, by the
    shortest way in the metric of P, and the level, averaged over a period, is the offset.

    An update costs some 3 N² multiplications for N = (1 + n)(1 + k) + m + 1 parameters, a
    sample some 3 N.

    Sources: K. Kuhnen, European Journal of Control 9 (2003) 407-418 (model); L. Ljung, System
    Identification, 2nd ed. (1999), sec. 11.2 (law).
    """

    __slots__ = ("_config", "_creep", "_initial", "_scale")

    _frozen_at = layout.FROZEN

    conformance_exceptions: ClassVar[dict[str, str]] = {
        "learns_the_parameters": "Its parameters are slopes of plays, not those of the Coleman-Hodgdon "
        "plant of that test.",
        "a_dwell_moves_nothing": "At a dwell creep shows, and its gains are learnt; no slope moves.",
        "works_in_the_ring": "Its model has another number of parameters than the ring's first one.",
        "a_missing_sample_changes_nothing_but_itself": "Samples are taken in windows of travel, and "
        "weights near zero differ by more than parts of themselves.",
    }

    def __init__(
        self,
        sample_rate: float,
        *,
        initial_model: PrandtlIshlinskii | ColemanHodgdon | LinearGain | None = None,
        voltage_range: tuple[float, float] | None = None,
        thresholds: int = 12,
        bends: int = 2,
        creep: Sequence[float] | ArrayLike = (0.01, 0.1, 1.0),
        uncertainty: float = 0.5,
        noise: float = 1.5e-3,
        delay: float = 0.0,
        mechanics: MassSpringDamper | None = None,
    ) -> None:
        sample_rate = moderate("sample_rate", sample_rate)
        initial = ColemanHodgdon(0.02, 0.12, 0.0036) if initial_model is None else initial_model
        plan = settings.plan(
            initial,
            voltage_range,
            integer("thresholds", thresholds, 0, MOST_THRESHOLDS),
            integer("bends", bends, 0, MOST_BENDS),
            array_1d("creep", creep),
        )
        if (parameters := plan.slopes.size + plan.times.size) > MOST_PARAMETERS:
            raise ValueError(
                f"thresholds, bends and creep make {parameters} parameters, more than {MOST_PARAMETERS}: "
                "take fewer"
            )
        fraction, line = delay_line(delay)
        self._initial = initial
        self._creep = plan.times
        config = np.zeros(layout.CONFIG)
        n, k, m = plan.relative.size, plan.bends.size, plan.times.size
        size = layout.lay_out(config, n, k, m, line.size)
        config[layout.GAIN] = plan.unit
        config[layout.NOISE] = moderate("noise", noise, or_zero=True)
        config[layout.FRACTION] = fraction
        config[layout.FIXED] = plan.fixed
        config[layout.FIRST_HALF] = max(1.0, settings.FIRST_HALF * sample_rate)
        config[layout.LONGEST_GAP] = max(1, int(settings.LONGEST_GAP * sample_rate))
        settings.tune(config)
        theta, spread, P = settings.prior(plan, moderate("uncertainty", uncertainty), config)
        decays = np.exp(-1.0 / (sample_rate * plan.times))
        if mechanics is not None and not isinstance(mechanics, MassSpringDamper):
            raise ValueError(f"mechanics must be a MassSpringDamper, got {mechanics!r}")
        config[layout.INERT] = mechanics is not None
        motion = np.zeros(6) if mechanics is None else mechanics.coefficients(sample_rate)
        self._config = np.concatenate([config, plan.relative, plan.bends, decays, P.ravel(), spread, motion])
        state = np.zeros(size)
        state[layout.CENTRE], state[layout.RANGE] = plan.centre, plan.half
        for name, values in ((layout.THETA, theta), (layout.P, P.ravel()), (layout.LINE, line)):
            place = int(config[name])
            state[place : place + values.size] = values
        state[layout.OFFSET] = theta[-1]
        kernel.start(state, self._config)
        slopes = (n + 1) * (k + 1)
        self._scale = np.append(np.full(slopes, plan.unit), np.ones(m))
        self._begin(
            {
                "sample_rate": sample_rate,
                "initial_model": initial.to_dict(),
                "voltage_range": None if voltage_range is None else [float(v) for v in voltage_range],
                "thresholds": int(thresholds),
                "bends": int(bends),
                "creep": np.asarray(creep, dtype=np.float64).tolist(),
                "uncertainty": float(uncertainty),
                "noise": float(noise),
                "delay": float(delay),
                "mechanics": None if mechanics is None else mechanics.to_dict(),
            },
            state,
        )

    @classmethod
    def _revive(cls, arguments: dict[str, Any]) -> dict[str, Any]:
        given = super()._revive(arguments)
        if given.get("mechanics") is not None:
            given["mechanics"] = MassSpringDamper.from_dict(given["mechanics"])
        return given

    def _table(self) -> Table:
        return state_tables.play_rls(self._config, self._state.size)

    def _sample(self, u: float, x: float) -> None:
        kernel.step(self._state, self._config, u, x)

    def _run(self, u: FloatArray, x: FloatArray, every: int, want: frozenset[str]) -> Trace:
        rows, n, size = u.size // every, self._scale.size, self._scale.size + 1
        theta = np.empty((rows, n))
        y = np.empty(rows if "y" in want else 0)
        S = np.empty(rows if "S" in want else 0)
        P = np.empty((rows if "P" in want else 0, size * size))
        kernel.run(self._state, self._config, u, x, every, self._scale, theta, NO_ROWS, y, S, P)
        return Trace(
            index=np.arange(every - 1, rows * every, every),
            theta=theta,
            parameter_names=self.parameter_names,
            y=y if "y" in want else None,
            S=S if "S" in want else None,
            P=P.reshape(-1, size, size)[:, :n, :n] * np.outer(self._scale, self._scale)
            if "P" in want
            else None,
        )

    def _part(self, name: int, size: int) -> FloatArray:
        place = int(self._config[name])
        return self._state[place : place + size]

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`: slopes of the voltage and of each play, then creep gains.

        With bends each slope has an entry for each segment of the voltage, from the lowest.
        """
        n, columns = int(self._config[layout.PLAYS]), int(self._config[layout.BENDS]) + 1
        slopes = ["gain", *(f"weights[{i}]" for i in range(n))]
        if columns > 1:
            slopes = [f"{name} in segment {s}" for name in slopes for s in range(columns)]
        return (*slopes, *(f"creep.gains[{j}]" for j in range(self._creep.size)))

    @property
    def thresholds(self) -> FloatArray:
        """Thresholds of the plays in use [V], shape (n,)."""
        return self._part(layout.THRESHOLDS, int(self._config[layout.PLAYS])).copy()

    @property
    def theta(self) -> FloatArray:
        """Slopes [µm/V] and creep gains [1] as estimated, shape (n,), in the order of `parameter_names`."""
        return self._part(layout.THETA, self._scale.size) * self._scale

    @property
    def _usable(self) -> FloatArray:
        """`theta`, or its nearest point in the metric of P where nothing is below its least."""
        return self._part(layout.USED, self._scale.size) * self._scale

    @property
    def P(self) -> FloatArray:
        """Covariance of `theta` as the law sees it, shape (n, n)."""
        n, size = self._scale.size, self._scale.size + 1
        P = self._part(layout.P, size * size).reshape(size, size)[:n, :n]
        return P * np.outer(self._scale, self._scale)

    @property
    def standard_errors(self) -> FloatArray:
        """Standard deviations of `theta` as the law sees them, shape (n,)."""
        return np.sqrt(np.fmax(np.diag(self.P), 0.0))

    @property
    def y(self) -> float:
        """Last innovation [µm], of the mean over a window of travel."""
        return float(self._state[layout.INNOVATION])

    @property
    def S(self) -> float:
        """Variance of the last innovation as the law saw it [µm²]."""
        return float(self._state[layout.VARIANCE])

    @property
    def K(self) -> FloatArray:
        """Gain that the present covariance gives the last regressor, shape (n,)."""
        size = self._scale.size + 1
        P = self._part(layout.P, size * size).reshape(size, size)
        phi = self._part(layout.PHI, size)
        product = P @ phi
        stroke = self._config[layout.GAIN] * self._state[layout.RANGE]
        return (
            product[:-1]
            * self._scale
            / (phi @ product + (self._config[layout.SLACK] * stroke) ** 2 + self._config[layout.NOISE] ** 2)
        )

    @property
    def status(self) -> Status:
        """What happened to the samples so far."""
        state = self._state
        return Status(
            samples=int(state[layout.SAMPLES]),
            updates=int(state[layout.UPDATES]),
            missing=int(state[layout.MISSED]),
            held=int(state[layout.HELD]),
            outliers=int(state[layout.OUTLIERS]),
            resets=int(state[layout.RESETS]),
            projected=bool(np.any(self._part(layout.FORCE, self._scale.size) > 0.0)),
            last=("waiting", "updated", "missing", "held", "rejected")[int(state[layout.LAST])],
        )

    @property
    def model(self) -> Model:
        """Model as known now, always admissible: a `LinearGain` if it began as one."""
        offset = float(self._state[layout.OFFSET])
        if isinstance(self._initial, LinearGain):
            return LinearGain(float(self._usable[0]), offset)
        n, k, m = (int(self._config[name]) for name in (layout.PLAYS, layout.BENDS, layout.TERMS))
        theta = self._usable
        slopes = theta[: (n + 1) * (k + 1)].reshape(n + 1, k + 1)
        bends = self._part(layout.EDGES, k + 2)[1:-1]
        return PrandtlIshlinskii(
            float(slopes[0, 0]),
            self.thresholds,
            slopes[1:, 0],
            offset,
            creep=Creep(theta[theta.size - m :], self._creep) if m else None,
            bends=bends,
            bend_weights=np.diff(slopes, axis=1).T,
            sample_rate=self.sample_rate,
        )
