"""Parameters of a model in rows, as texts and tables show them."""

from __future__ import annotations

from typing import Any

Row = tuple[str, float, float, str]
# More parameters than this are not listed one by one.
MOST_ROWS = 12


def parameter_rows(model: Any, delay: float, errors: dict[str, float]) -> list[Row]:
    """Rows of parameter name, value, standard error (zero if it was not estimated) and unit."""
    values = list(zip(model.parameter_names, model.theta.tolist(), model.parameter_units, strict=True))
    if len(values) > MOST_ROWS:
        values = [row for row in values if row[0] == "gain" or row[0].startswith("creep")]
        weights = [(name, value) for name, value in zip(model.parameter_names, model.theta, strict=True)
                   if name.startswith("weights")]  # fmt: skip
        values.append((f"sum of {len(weights)} weights", float(sum(value for _, value in weights)), "µm/V"))
    values += [("offset", model.offset, "µm"), ("delay", delay, "samples")]
    return [(name, value, errors.get(name, 0.0), unit) for name, value, unit in values]
