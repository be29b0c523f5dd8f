"""Recursive least squares of a Prandtl-Ishlinskii model with creep and asymmetry."""

from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from piezoest._checks import FloatArray, array_1d, instance, integer, moderate, non_negative
from piezoest.estimators import play_grid
from piezoest.estimators import play_rls_kernel as kernel
from piezoest.estimators.compiled import Freezable
from piezoest.estimators.delay_line import delay_line
from piezoest.estimators.saved_state import Rule
from piezoest.layout import ABSENT, Named
from piezoest.models import ColemanHodgdon, Creep, LinearGain, MassSpringDamper, Model, PrandtlIshlinskii

FIRST_HALF_PERIOD = 0.1  # s, before the voltage has turned
LONGEST_GAP = 2e-3  # s, after which an outlier is a new level
# Most of each: an update costs the square of the parameters, and so does their memory.
MOST_THRESHOLDS, MOST_BENDS, MOST_PARAMETERS = 200, 50, 1000


class PrandtlIshlinskiiRLS(Freezable):
    """Recursive least squares of a Prandtl-Ishlinskii model with creep, asymmetry and offset.

    x = K u + sum_i p_i play_i(u) + sum_j c_j creep_j + level is linear in its parameters, with
    regressors from the voltage alone: no derivative of x is taken, minor loops are part of
    the model, and one set of parameters serves all amplitudes.

    Parameters
    ----------
    sample_rate : float
        [Hz].
    initial_model : PrandtlIshlinskii, ColemanHodgdon or LinearGain, optional
        Initial model. The thresholds, bends and time constants of creep of a `PrandtlIshlinskii` are
        kept. A `ColemanHodgdon` (default ``ColemanHodgdon(0.02, 0.12, 0.0036)``) is converted to
        weights with the same loop. With a `LinearGain` only the gain is estimated.
    voltage_range : tuple of float, optional
        Smallest and largest voltage [V]. Default: learnt. The grid then grows with the voltage. If it
        is too wide after four turning points, it shrinks once.
    thresholds : int
        Number n of plays, up to 200. The i-th threshold is i/n of half the voltage range.
    bends : int
        Number k of voltages at which slopes may change, up to 50, evenly over the range; 0 for a
        symmetric loop.
    creep : tuple of float
        Time constants of creep [s]; empty for none.
    uncertainty : float
        Relative standard deviation of the initial model's scale and of the shape of its loop.
    noise : float
        Standard deviation of the displacement's noise [µm].
    delay : float
        Samples by which the measured displacement lags the voltage, up to a million; may be fractional.
    mechanics : MassSpringDamper, optional
        Resonance through which the voltage is filtered first, so that it is not learnt as hysteresis.
        Use it with a `LeadFilter`, for references close to the resonance.

    Raises
    ------
    ValueError
        If a value is out of its range.

    Notes
    -----
    The law is a Kalman filter with random-walk parameters. It depends on the travel of the voltage and not
    on time: samples are averaged until the voltage has travelled 1/32 of half the range; then one update
    is made. The variance of each parameter grows with the travel of its own regressor, at most to its
    initial value. So a weight whose play does not move is not forgotten. An additional parameter, the level,
    may change fast and absorbs slow disturbances. At rest only the level and the creep gains change. `theta`
    holds slopes and creep gains. `model` has the nearest values, in the metric of P, with weights and creep
    gains of at least zero and a gain of at least 5 % of the initial one. Its offset is the level averaged
    over a period.

    An update costs about 3 N² multiplications for N = (1 + n)(1 + k) + m + 1 parameters (m creep terms), a
    sample about 3 N.

    Sources: K. Kuhnen, European Journal of Control 9 (2003) 407-418 (model); L. Ljung, System
    Identification, 2nd ed. (1999), sec. 11.2 (law).

    Examples
    --------
    >>> import piezoest as pz
    >>> fs = 10_000.0
    >>> u = pz.signals.two_tone([20.0, 10.0], [2.0, 7.0], 1.0, fs).values
    >>> x = pz.PaperStage(fs, seed=0).run(u)
    >>> estimator = pz.PrandtlIshlinskiiRLS(fs)
    >>> trace = estimator.run(u, x)
    >>> compensator = pz.InverseCompensator(estimator.model)
    """

    __slots__ = ("_creep", "_scale")

    kernel: ClassVar[Any] = kernel

    conformance_exceptions: ClassVar[dict[str, str]] = {
        "learns_the_parameters": "Its parameters are slopes of plays, not those of the Coleman-Hodgdon "
        "plant of that test.",
        "a_dwell_moves_nothing": "At a dwell creep shows, and its gains are learnt; no slope moves.",
        "works_in_the_ring": "Its model has another number of parameters than the loop's first one.",
        "a_missing_sample_changes_nothing_but_itself": "Samples are taken in windows of travel, and "
        "after a gap weights near zero differ by more than the relative tolerance.",
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
        initial = self._start_from(initial_model, PrandtlIshlinskii, ColemanHodgdon, LinearGain)
        plan = play_grid.plan(
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
        instance("mechanics", mechanics, MassSpringDamper | None, "a MassSpringDamper")
        theta, spread, P = play_grid.prior(plan, moderate("uncertainty", uncertainty))
        line, line_start = delay_line(delay)
        coefficients = {} if mechanics is None else {"coefficients": mechanics.coefficients(sample_rate)}
        self._creep = plan.times
        self._scale = np.append(np.full(plan.slopes.size, plan.unit), np.ones(plan.times.size))
        self._configure(
            kernel.settings_layout(plan),
            {
                "unit": plan.unit,
                "noise": moderate("noise", noise, or_zero=True),
                "first_half_period": max(1.0, FIRST_HALF_PERIOD * sample_rate),
                "longest_gap": max(1, int(LONGEST_GAP * sample_rate)),
                "grid_is_fixed": plan.fixed or plan.relative.size == 0,
                "relative_thresholds": plan.relative,
                "relative_bends": plan.bends,
                "decays": np.exp(-1.0 / (sample_rate * plan.times)),
                "prior": P,
                "spread": spread,
            },
        )
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
                "delay": non_negative("delay", delay),
                "mechanics": None if mechanics is None else mechanics.to_dict(),
            },
            kernel.layout(plan, line, ABSENT if mechanics is None else kernel.RESONANCE),
            {
                "plays": {"centre": plan.centre, "half_width": plan.half_width},
                "law": {"theta": theta, "P": P},
                "offset": theta[-1],
                "line": line_start,
                "resonance": coefficients,
            },
        )
        kernel.start(Named(self._state, self._layout), self._named_settings)
        self._start = self._state.copy()

    @property
    def _named_settings(self) -> Named:
        return Named(self._settings, self._settings_layout)

    def _rules(self, state: Any) -> Iterable[Rule]:
        yield from super()._rules(state)
        plays, used = state["plays"], state["law"]["used"][:-1]
        anew = state.copy()
        play_grid.lay(Named(anew, self._layout).plays, self._named_settings)
        laid = anew["plays"]
        as_laid = all(np.array_equal(laid[name], plays[name]) for name in ("reach", "lower", "upper", "zero"))
        usable = np.all(used >= 0.0) and np.all(used[: self._columns] >= kernel.LEAST_GAIN)
        yield "the grid must be as its middle and half-width lay it", as_laid
        yield "the parameters in use must be zero or more", usable

    def _shown(self, name: str, values: FloatArray, rows: FloatArray) -> Any:
        n = self._scale.size
        return values[..., :n, :n] * np.outer(self._scale, self._scale) if name == "P" else values

    @property
    def _columns(self) -> int:
        """Segments of the voltage."""
        return int(self._settings["relative_bends"].size) + 1

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`: slopes of the voltage and of each play, then creep gains.

        With bends each slope has an entry for each segment of the voltage, from the lowest.
        """
        columns = self._columns
        slopes = ["gain", *(f"weights[{i}]" for i in range(self._settings["relative_thresholds"].size))]
        if columns > 1:
            slopes = [f"{name} in segment {s}" for name in slopes for s in range(columns)]
        return (*slopes, *(f"creep.gains[{j}]" for j in range(self._creep.size)))

    @property
    def thresholds(self) -> FloatArray:
        """Thresholds of the plays in use [V], shape (n,)."""
        return self._state["plays"]["reach"][self._columns :: self._columns].copy()

    @property
    def _row(self) -> FloatArray:
        return self._state["law"]["theta"][:-1] * self._scale

    @property
    def K(self) -> FloatArray:
        """Gain that the present covariance gives the last regressor, shape (n,)."""
        state, settings = self._state, self._settings
        phi = state["plays"]["phi"]
        product = state["law"]["P"] @ phi
        misfit = kernel.SLACK * (settings["unit"] * state["plays"]["half_width"])
        return product[:-1] * self._scale / (phi @ product + misfit**2 + settings["noise"] ** 2)

    def _is_projected(self) -> bool:
        return bool(np.any(self._state["law"]["force"][:-1] > 0.0))

    @property
    def model(self) -> Model:
        """Model as known now, always admissible: a `LinearGain` if it began as one."""
        offset, theta = float(self._state["offset"]), self._state["law"]["used"][:-1] * self._scale
        if isinstance(self._initial, LinearGain):
            return LinearGain(float(theta[0]), offset)
        m, columns = self._creep.size, self._columns
        slopes = theta[: theta.size - m].reshape(-1, columns)
        return PrandtlIshlinskii(
            float(slopes[0, 0]),
            self.thresholds,
            slopes[1:, 0],
            offset,
            creep=Creep(theta[theta.size - m :], self._creep) if m else None,
            bends=self._state["plays"]["lower"][1:columns].copy(),
            bend_weights=np.diff(slopes, axis=1).T,
            sample_rate=self.sample_rate,
        )
