"""A controller in C99: estimator, hand-over of the model and inverse, from the library's own equations."""

from typing import Any

import numpy as np

from piezoest._checks import integer
from piezoest.compensators import Compensator, inverse_kernel
from piezoest.controller.adaptive_feedforward import AdaptiveFeedforward
from piezoest.equations import turning_points
from piezoest.estimators.compiled import CompiledEstimator
from piezoest.export import feedforward, ring
from piezoest.export.c_translator import call
from piezoest.export.c_values import Array, Known, Number, Root, Struct, Value, literal
from piezoest.export.generated import CCode, Precision, estimator_lines, file_of, rendered
from piezoest.layout import new, record
from piezoest.models import ColemanHodgdon, Model, PrandtlIshlinskii

_CHANGE = """\
/* Use another model, without a bump; freeze before, or the next one learnt replaces it. An inadmissible
 * model is replaced by its nearest admissible one; returns 0, and changes nothing, if there is none. */"""
_NO_CHANGE = "/* The model of this controller is fixed: returns 0, and changes nothing. */"
_ADOPT = """{real} model[4];

    for (int i = 0; i < 4; ++i) {{
        model[i] = parameters[i];
    }}
    return {adopt};"""
_NO_ADOPT = "(void)state;\n    (void)parameters;\n    return 0;"
_LEARN = "if (state->ring.started != {zero}) {{\n        {learn};\n    }}"

_FIXED = "it fixed: c(None, InverseCompensator(estimator.model))"
_INTERVAL = 50


def c(
    estimator: Any,
    compensator: Compensator | None = None,
    *,
    name: str = "piezoest_controller",
    precision: Precision = "double",
    update_interval: int = _INTERVAL,
) -> CCode:
    """Generate a controller in C99: an `AdaptiveFeedforward`, or what `Controller` does with two objects.

    One header, one source; no allocation, no library but ``math.h``; all state in one struct. The code
    is translated from the functions that the library itself runs.

    Parameters
    ----------
    estimator : AdaptiveFeedforward, HysteresisRLS, HysteresisEKF, OutputErrorRLS or None
        In its present state; None for feed-forward with a fixed model.
    compensator : InverseCompensator or LinearCompensator, optional
        In its present state, with its limits. A `PrandtlIshlinskii` model in it stays fixed. Left out with
        an `AdaptiveFeedforward`, which has its own.
    name : str
        Prefix of all public names, and name of the files.
    precision : {"double", "float"}
        Type of the numbers.
    update_interval : int
        Samples between two changes of the compensator's model (default 50: 1 ms at 50 kHz). An
        `AdaptiveFeedforward` goes by travel and has none.

    Returns
    -------
    CCode

    Raises
    ------
    ValueError
        If an object is of a kind that cannot be exported, limits are for another sample rate than the
        estimator, the name is no identifier, or the precision is unknown.

    Examples
    --------
    >>> import piezoest as pz
    >>> fs, start = 50_000.0, pz.ColemanHodgdon(alpha=0.02, beta=0.12, gamma=0.0036)
    >>> estimator = pz.HysteresisRLS(fs, initial_model=start)
    >>> code = pz.export.c(estimator, pz.InverseCompensator(start), precision="float")
    >>> "piezoest_controller_step" in code.header
    True
    """
    if isinstance(estimator, AdaptiveFeedforward):
        if compensator is not None or update_interval != _INTERVAL:
            raise ValueError(
                "an AdaptiveFeedforward is exported alone: leave out compensator and update_interval"
            )
        return feedforward.code(estimator, name, precision)
    interval = integer("update_interval", update_interval, 1)
    if not isinstance(compensator, Compensator):
        raise ValueError(
            "give an AdaptiveFeedforward alone, or an estimator or None and, as compensator, an "
            f"InverseCompensator or a LinearCompensator, got {estimator!r} and {compensator!r}"
        )
    exportable = isinstance(estimator, CompiledEstimator) and hasattr(estimator.kernel, "proposed")
    if estimator is not None and not exportable:
        hint = "only estimators with a compiled kernel can be exported"
        if isinstance(getattr(estimator, "model", None), PrandtlIshlinskii):
            hint = "learn a Prandtl-Ishlinskii model beside the controller, and export " + _FIXED
        raise ValueError(
            f"estimator must be one such as HysteresisRLS, got {type(estimator).__name__}: {hint}"
        )
    ring.check_limits(estimator, compensator)
    return _Generator(estimator, compensator, name, precision, interval).code()


def _described(model: Model) -> str:
    """The model in one line; the numbers of plays stand in the settings."""
    if not isinstance(model, PrandtlIshlinskii):
        return str(model)
    terms = 0 if model.creep is None else model.creep.gains.size
    return (
        f"PrandtlIshlinskii of {model.thresholds.size} plays, {model.bends.size} bends and {terms} creep "
        f"terms, gain {model.gain!r}, offset {model.offset!r}"
    )


class _Generator:
    """A controller of these two objects, translated."""

    def __init__(self, estimator: Any, compensator: Compensator, name: str, precision: str, interval: int):
        self.estimator, self.compensator, self.interval = estimator, compensator, interval
        changes = hasattr(compensator.model.inverse, "change")
        unneeded = () if estimator is None else estimator.unneeded
        if not changes:
            # Only another model's plays would be set from it.
            unneeded = (*unneeded, turning_points.remember)
        self.file = file_of(name, precision, unneeded)
        model = compensator.model if estimator is None else estimator.model
        self.hysteretic = isinstance(model, ColemanHodgdon)
        if estimator is not None and not changes:
            raise ValueError(
                f"the code for a {type(compensator.model).__name__} takes no other model: leave out the "
                "estimator, or start the compensator with a ColemanHodgdon or LinearGain"
            )
        if estimator is not None:
            kind: Any = type(compensator)
            kind(model, compensator.limits)  # which refuses what it cannot invert
        self.state, settings, kernel = self._state(), self._settings(), Known(inverse_kernel)
        self.file.struct(self.state.layout, "state")
        self.give = self._call(ring.give, kernel, Number("r", "real"))
        self.adopt = self.learn = ""
        if changes:
            self.adopt = self._call(ring.adopt, settings, kernel, Array("model", (4,), Root("model")))
        if estimator is not None:
            arguments = settings, Known(estimator.kernel), kernel, Number("x", "real")
            self.learn = self._call(ring.learn, *arguments)

    def _state(self) -> Struct:
        """All that changes."""
        compensator, model, estimator = self.compensator, self.compensator.model, self.estimator
        parameters = np.zeros(4)
        first = [model.gain] if hasattr(model, "gain") else model.theta
        parameters[: len(first)] = first
        parameters[3] = model.offset
        layouts = compensator.layouts
        fields = {"ring": ring.RING, "compensator": layouts[0], "settings": layouts[1]}
        values = {"compensator": compensator.state, "settings": compensator.settings}
        if estimator is not None:
            fields["estimator"], values["estimator"] = estimator.layouts[0], estimator.state
        layout = record(**fields)
        start = new(layout, ring={"voltage": compensator.voltage, "model": parameters}, **values)
        return Struct("state->", layout, start, Root("state"), "state")

    def _settings(self) -> Struct:
        """What never changes."""
        state, own = (record(), record()) if self.estimator is None else self.estimator.layouts
        layout = ring.settings_layout(own)
        freezable, hysteretic = "frozen" in state.by_name, self.hysteretic
        values = new(layout, interval=self.interval, freezable=freezable, hysteretic=hysteretic)
        if self.estimator is not None:
            values["estimator"] = self.estimator.settings
        return Struct("", layout, values, Root(""), "settings", constant=True)

    def _call(self, function: Any, *arguments: Value) -> str:
        return call(self.file, function, [self.state, *arguments])

    def code(self) -> CCode:
        """Put the pieces together."""
        file, give, adopt, learn = self.file, self.give, self.adopt, self.learn
        zero, one = literal(0.0, file.single), literal(1.0, file.single)
        model = "alpha [1/V], beta [um/V], gamma [um/V^2]" if self.hysteretic else "gain [um/V], 0, 0"
        return rendered(
            file,
            "controller",
            self._provenance(),
            {"model": model, "change": _CHANGE if adopt else _NO_CHANGE},
            {
                "start": file.start(self.state.layout, self.state.values),
                "functions": file.text(f"{give} {adopt} {learn}"),
                "learn": _LEARN.format(zero=zero, learn=learn) if learn else "(void)x;",
                "give": give,
                "adopt": _ADOPT.format(real=file.real, adopt=adopt) if adopt else _NO_ADOPT,
                "zero": zero,
                "one": one,
            },
            learns=self.estimator is not None,
        )

    def _provenance(self) -> list[str]:
        """What the code was made from."""
        lines = [
            f"Compensator: {type(self.compensator).__name__}, {_described(self.compensator.model)}.",
            f"Limits: {self.compensator.limits}.",
        ]
        if self.estimator is None:
            return [*lines, "Estimator: none."]
        return [
            *lines,
            *estimator_lines(self.estimator.to_dict()),
            f"Model handed over every {self.interval} samples.",
        ]
