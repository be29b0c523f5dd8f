"""A controller in C99: estimator, hand-over of the model and inverse, from the library's own equations."""

from __future__ import annotations

import keyword
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from piezoest._checks import integer
from piezoest._files import write_text
from piezoest._version import __version__
from piezoest.compensators import Compensator
from piezoest.compensators.adoption import adopt
from piezoest.compensators.layout import OFFSET
from piezoest.equations import turning_points
from piezoest.estimators.base import Compiled
from piezoest.export import c_text as text
from piezoest.export import ring
from piezoest.export.c_translator import Translator
from piezoest.export.c_values import Array, Expr, Known, Root, Value
from piezoest.models import ColemanHodgdon, Model, PrandtlIshlinskii

Precision = Literal["double", "float"]

_FIXED = "it fixed: c(None, InverseCompensator(estimator.model))"
# What rounding cannot tell apart is more in float, and what is beyond all measure is less.
_FLOAT = {
    ("piezoest.equations.bent_plays", "SAME"): 1e-5,
    ("piezoest.equations.least_squares", "LARGEST"): 1e36,
    ("piezoest.equations.least_squares", "TRACE_WEIGHT"): 1e18,
    ("piezoest.equations.kalman", "LARGEST"): 1e36,
    ("piezoest.equations.kalman", "LARGEST_TRACE"): 1e18,
    ("piezoest.equations.admissible", "LARGEST"): 1e18,
    ("piezoest.equations.admissible", "SMALLEST"): 1e-18,
}


@dataclass(frozen=True, slots=True)
class CCode:
    """A generated controller.

    Parameters
    ----------
    name : str
        Prefix of all public names, and name of the files.
    header, source : str
        Text of ``NAME.h`` and ``NAME.c``.
    precision : str
        ``"double"`` or ``"float"``.
    learns : bool
        Whether there is an estimator in it.
    """

    name: str
    header: str
    source: str
    precision: str
    learns: bool

    def write(self, directory: str | Path) -> tuple[Path, Path]:
        """Write header and source into a folder, which is made if need be.

        Parameters
        ----------
        directory : str or Path
            The folder.

        Returns
        -------
        tuple of Path
            Header and source.
        """
        folder = Path(directory)
        folder.mkdir(parents=True, exist_ok=True)
        paths = folder / f"{self.name}.h", folder / f"{self.name}.c"
        for path, content in zip(paths, (self.header, self.source), strict=True):
            write_text(path, content)
        return paths


def c(
    estimator: Any,
    compensator: Compensator,
    *,
    name: str = "piezoest_controller",
    precision: Precision = "double",
    update_interval: int = 50,
) -> CCode:
    """Generate a controller in C99 that does what `Controller` does with the same two objects.

    One header, one source; no allocation, no library but ``math.h`` (exp, fabs, sqrt); all state
    in one struct. The code is translated from the functions that the library itself runs.

    Parameters
    ----------
    estimator : HysteresisRLS, HysteresisEKF or None
        In its present state; None for feed-forward with a fixed model.
    compensator : InverseCompensator or LinearCompensator
        In its present state, with its limits. A `PrandtlIshlinskii` model in it stays fixed.
    name : str
        Prefix of all public names, and name of the files.
    precision : {"double", "float"}
        Type of the numbers.
    update_interval : int
        Samples between two changes of the compensator's model (default 50: 1 ms at 50 kHz).

    Returns
    -------
    CCode

    Raises
    ------
    ValueError
        If an object is of a kind that cannot be exported, the name is no identifier, or the
        precision is unknown.
    """
    if not name.isidentifier() or not name.isascii() or keyword.iskeyword(name) or name.startswith("_"):
        raise ValueError(f"name must be an identifier of C, got {name!r}: use letters, digits and _")
    if precision not in ("double", "float"):
        raise ValueError(f"precision must be 'double' or 'float', got {precision!r}")
    interval = integer("update_interval", update_interval, 1)
    if not hasattr(compensator, "_compiled"):
        raise ValueError(
            f"compensator must be an InverseCompensator or a LinearCompensator, got {compensator!r}"
        )
    if estimator is not None and not _has_kernel(estimator):
        hint = "only estimators with a compiled kernel can be exported"
        if isinstance(getattr(estimator, "model", None), PrandtlIshlinskii):
            hint = "learn a Prandtl-Ishlinskii model beside the controller, and export " + _FIXED
        raise ValueError(
            f"estimator must be a HysteresisRLS or a HysteresisEKF, got {type(estimator).__name__}: {hint}"
        )
    return _Generator(estimator, compensator, name, precision, interval).code()


def _has_kernel(estimator: Any) -> bool:
    """Whether its samples are taken by the compiled functions that it or a base of it names."""
    kind = type(estimator)
    owner = next((base for base in kind.__mro__ if isinstance(vars(base).get("_compiled"), Compiled)), None)
    return owner is not None and kind._sample is owner._sample  # type: ignore[attr-defined]


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
    def __init__(self, estimator: Any, compensator: Compensator, name: str, precision: str, interval: int):
        self.estimator, self.compensator, self.name, self.interval = estimator, compensator, name, interval
        self.precision = precision
        unneeded = () if estimator is None else estimator._compiled.unneeded
        self.voltage, self.change = compensator._compiled
        if self.change is None:
            # Only another model's plays would be set from it.
            unneeded = (*unneeded, turning_points.remember)
        single = precision == "float"
        self.translator = Translator(precision, single, unneeded, _FLOAT if single else {})
        self.members: list[tuple[str, np.ndarray[Any, Any], str]] = []
        self.hysteretic = isinstance(compensator.model, ColemanHodgdon)
        if estimator is not None:
            if self.change is None:
                kind = type(compensator.model).__name__
                raise ValueError(
                    f"the code for a {kind} takes no other model: leave out the estimator, "
                    "or start the compensator with a ColemanHodgdon or LinearGain"
                )
            compensator._accepts(estimator.model)
            self.hysteretic = isinstance(estimator.model, ColemanHodgdon)

    def code(self) -> CCode:
        """Translate, and put the pieces together."""
        model = self.compensator.model
        start = np.zeros(ring.STATE)
        start[ring.PREVIOUS] = self.compensator.voltage
        if self.change is not None:
            start[ring.MODEL : ring.MODEL + model.theta.size] = model.theta
            start[ring.MODEL + 3] = self.compensator._config[OFFSET]
        elif isinstance(model, PrandtlIshlinskii):
            start[ring.MODEL], start[ring.MODEL + 3] = model.gain, model.offset
        self.member("ring", start, "voltage given out last, counters, model in use")
        if self.estimator is not None:
            self.member("estimator", self.estimator._state, "state of the estimator")
        self.member("compensator", self.compensator._state, "state of the compensator")
        self.member("settings", self.compensator._config, "inverse and limits of the compensator")
        entries = {"give": self.entry_give()}
        if self.change is not None:
            entries["adopt"] = self.entry_adopt()
        if self.estimator is not None:
            entries["learn"] = self.entry_learn()
        return CCode(
            self.name,
            text.header(self),
            text.source(self, entries),
            self.precision,
            self.estimator is not None,
        )

    def member(self, name: str, values: Any, meaning: str) -> None:
        """One array of the state."""
        self.members.append((name, np.asarray(values, dtype=np.float64), meaning))

    def array(self, name: str, known: tuple[tuple[int, float], ...] = ()) -> Array:
        """An array of the state as an argument."""
        size = next(values.size for member, values, _ in self.members if member == name)
        return Array(f"state->{name}", Root(), size=size, known=known)

    def compensator_arrays(self) -> tuple[Array, Array]:
        """State and settings; what no change of model or limits touches is known."""
        fixed = self.compensator._fixed
        known = tuple((i, float(self.compensator._config[i])) for i in fixed)
        return self.array("compensator"), self.array("settings", known)

    def entry_give(self) -> str:
        """Call of `ring.give`."""
        arguments: list[Value] = [self.array("ring"), *self.compensator_arrays(), Known(self.voltage)]
        return self.call(ring.give, [*arguments, Expr("r", "real")])

    def entry_adopt(self) -> str:
        """Call of `adoption.adopt`."""
        model = Array("model", Root(), size=4)
        flags: list[Value] = [Known(self.hysteretic), Known(self.change)]
        return self.call(adopt, [*self.compensator_arrays(), model, *flags])

    def entry_learn(self) -> str:
        """Call of `ring.learn`."""
        compiled, table = self.estimator._compiled, self.translator.table
        frozen_at = -1 if compiled.frozen is None else compiled.frozen
        arguments: list[Value] = [
            self.array("ring"),
            self.array("estimator"),
            table("estimator_settings", tuple(self.estimator._config)),
            table("estimator_terms", tuple(self.estimator._terms)),
            *self.compensator_arrays(),
            Known(compiled.sample),
            Known(compiled.proposed),
            Known(self.change),
            Known(self.interval),
            Known(frozen_at),
            Known(self.hysteretic),
            Expr("x", "real"),
        ]
        return self.call(ring.learn, arguments)

    def call(self, function: Any, arguments: list[Value]) -> str:
        """Text of a call of a translated function."""
        made, flat = self.translator.function(function, arguments)
        passed = []
        for place, _, _ in made.parameters:
            value = flat[place]
            assert isinstance(value, Array | Expr)
            passed.append(value.base if isinstance(value, Array) else value.text)
        return f"{made.name}({', '.join(passed)})"

    @property
    def provenance(self) -> list[str]:
        """What the code was made from."""
        estimator = "none" if self.estimator is None else type(self.estimator).__name__
        lines = [
            f"Generated by piezoest {__version__}; regenerate it instead of editing it.",
            f"Compensator: {type(self.compensator).__name__}, {_described(self.compensator.model)}.",
            f"Limits: {self.compensator.limits}.",
            f"Estimator: {estimator}.",
        ]
        if self.estimator is not None:
            for key, value in self.estimator._arguments.items():
                lines.append(f"    {key} = {value}")
            lines.append(f"Model handed over every {self.interval} samples.")
        return lines
