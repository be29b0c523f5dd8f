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
from piezoest.export.c_values import Array, Known, Number, Root, Struct, literal
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
            hint = (
                "learn a Prandtl-Ishlinskii model beside the controller, and export it fixed: "
                "c(None, InverseCompensator(estimator.model))"
            )
        raise ValueError(
            f"estimator must be one such as HysteresisRLS, got {type(estimator).__name__}: {hint}"
        )
    ring.check_limits(estimator, compensator)
    return _generate(estimator, compensator, name, precision, interval)


def _described(model: Model) -> str:
    """The model in one line; the numbers of plays stand in the settings."""
    if not isinstance(model, PrandtlIshlinskii):
        return str(model)
    terms = 0 if model.creep is None else model.creep.gains.size
    return (
        f"PrandtlIshlinskii of {model.thresholds.size} plays, {model.bends.size} bends and {terms} creep "
        f"terms, gain {model.gain!r}, offset {model.offset!r}"
    )


def _generate(estimator: Any, compensator: Compensator, name: str, precision: str, interval: int) -> CCode:
    """Translate a controller of these two objects."""
    changes = hasattr(compensator.model.inverse, "change")
    if estimator is not None and not changes:
        raise ValueError(
            f"the code for a {type(compensator.model).__name__} takes no other model: leave out the "
            "estimator, or start the compensator with a ColemanHodgdon or LinearGain"
        )
    unneeded = () if estimator is None else estimator.unneeded
    if not changes:
        # Only another model's plays would be set from it.
        unneeded = (*unneeded, turning_points.remember)
    file = file_of(name, precision, unneeded)
    model = compensator.model if estimator is None else estimator.model
    if estimator is not None:
        kind: Any = type(compensator)
        kind(model, compensator.limits)  # which refuses what it cannot invert
    hysteretic, kernel = isinstance(model, ColemanHodgdon), Known(inverse_kernel)
    state, settings = _state(estimator, compensator), _settings(estimator, interval, hysteretic)
    file.struct(state.layout, "state")
    give = call(file, ring.give, [state, kernel, Number("r", "real")])
    adopt = learn = ""
    if changes:
        adopt = call(file, ring.adopt, [state, settings, kernel, Array("model", (4,), Root("model"))])
    if estimator is not None:
        learn = call(
            file, ring.learn, [state, settings, Known(estimator.kernel), kernel, Number("x", "real")]
        )
    zero, one = literal(0.0, file.single), literal(1.0, file.single)
    parameters = "alpha [1/V], beta [um/V], gamma [um/V^2]" if hysteretic else "gain [um/V], 0, 0"
    return rendered(
        file,
        "controller",
        _provenance(estimator, compensator, interval),
        {"model": parameters, "change": _CHANGE if adopt else _NO_CHANGE},
        {
            "start": file.start(state.layout, state.values),
            "functions": file.text(f"{give} {adopt} {learn}"),
            "learn": _LEARN.format(zero=zero, learn=learn) if learn else "(void)x;",
            "give": give,
            "adopt": _ADOPT.format(real=file.real, adopt=adopt) if adopt else _NO_ADOPT,
            "zero": zero,
            "one": one,
        },
        learns=estimator is not None,
    )


def _state(estimator: Any, compensator: Compensator) -> Struct:
    """All that changes."""
    model, parameters, layouts = compensator.model, np.zeros(4), compensator.layouts
    first = [model.gain] if hasattr(model, "gain") else model.theta
    parameters[: len(first)] = first
    parameters[3] = model.offset
    fields = {"ring": ring.RING, "compensator": layouts[0], "settings": layouts[1]}
    values = {"compensator": compensator.state, "settings": compensator.settings}
    if estimator is not None:
        fields["estimator"], values["estimator"] = estimator.layouts[0], estimator.state
    layout = record(**fields)
    start = new(layout, ring={"voltage": compensator.voltage, "model": parameters}, **values)
    return Struct("state->", layout, start, Root("state"), "state")


def _settings(estimator: Any, interval: int, hysteretic: bool) -> Struct:
    """What never changes."""
    state, own = (record(), record()) if estimator is None else estimator.layouts
    layout = ring.settings_layout(own)
    values = new(layout, interval=interval, freezable="frozen" in state.by_name, hysteretic=hysteretic)
    if estimator is not None:
        values["estimator"] = estimator.settings
    return Struct("", layout, values, Root(""), "settings", constant=True)


def _provenance(estimator: Any, compensator: Compensator, interval: int) -> list[str]:
    """What the code was made from."""
    made_of = f"{type(compensator).__name__}, {_described(compensator.model)}"
    lines = [f"Compensator: {made_of}.", f"Limits: {compensator.limits}."]
    if estimator is None:
        return [*lines, "Estimator: none."]
    handed_over = f"Model handed over every {interval} samples."
    return [*lines, *estimator_lines(estimator.to_dict()), handed_over]
