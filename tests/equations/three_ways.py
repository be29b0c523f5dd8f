"""One function of named numbers, run as Python, as machine code and by CasADi."""

from types import SimpleNamespace
from typing import Any

import casadi
import numpy as np

from piezoest.layout import Named, Numbers, Record, leaves, new


def flat(layout: Record, array: Any) -> Any:
    """All numbers of a structured array."""
    return np.concatenate([np.ravel(numbers) for _, _, (numbers,) in leaves(layout, array)])


def three_ways(function: Any, layout: Record, **values: Any) -> tuple[Any, Any, Any]:
    """All numbers of a record after a compiled function of it: by Python, machine code and CasADi."""
    casadi.GlobalOptions.setNumpyMode(1)
    plain, machine = new(layout, **values), new(layout, **values)
    before = flat(layout, plain)
    function.function(Named(plain, layout))
    function.of(layout)(machine)
    symbols: list[Any] = []
    traced = _symbolic(layout, symbols)
    inputs = casadi.vertcat(*symbols)
    function.function(traced)
    outputs = casadi.vertcat(*_listed(layout, traced))
    symbolic = casadi.Function("f", [inputs], [outputs])(before).full().ravel()
    return flat(layout, plain), flat(layout, machine), symbolic


def _symbolic(layout: Record, symbols: list[Any]) -> Any:
    fields: dict[str, Any] = {}
    for name, field in layout.fields:
        if isinstance(field, Record):
            fields[name] = _symbolic(field, symbols)
            continue
        shape = field.counts if isinstance(field, Numbers) else ()
        made = np.empty(shape, dtype=object)
        for place in np.ndindex(shape):
            made[place] = casadi.SX.sym(name)
            symbols.append(made[place])
        fields[name] = made if shape else symbols[-1]
    return SimpleNamespace(**fields)


def _listed(layout: Record, traced: Any) -> list[Any]:
    listed: list[Any] = []
    for name, field in layout.fields:
        value = getattr(traced, name)
        if isinstance(field, Record):
            listed += _listed(field, value)
        else:
            listed += list(value.ravel()) if isinstance(field, Numbers) else [value]
    return listed
