"""What tables and files say of an identification: parameters, kinds of models, all figures."""

from typing import Any, NamedTuple

from piezoest.identification.residual import Misfit

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


class Kind(NamedTuple):
    """A kind of model beside the others, by what it misses; None where that is not known."""

    label: str
    chosen: bool
    left_out: float  # on blocks left out of the fit, by which the kind was chosen [µm rms]
    parameters: int | None = None
    train: Misfit | None = None
    held_out: Misfit | None = None

    def cells(self) -> tuple[str, ...]:
        """Label, marked if it was chosen, parameters, and errors: fitted, left out, held out, largest."""
        errors = (
            None if self.train is None else self.train.rms,
            self.left_out,
            None if self.held_out is None else self.held_out.rms,
            None if self.held_out is None else self.held_out.max,
        )
        return (
            f"{'▸' if self.chosen else ' '} {self.label}",
            "" if self.parameters is None else f"{self.parameters}",
            *("" if error is None else f"{error:.3g}" for error in errors),
        )


def figures_of(found: Any) -> dict[str, Any]:
    """What the dictionaries of all identifications have."""
    return {
        "source": found.source,
        "samples": found.samples,
        "sample_rate_Hz": found.sample_rate,
        "model": found.model.to_dict(),
        "learnt_on": found.learnt_on.to_dict(),
        "kind": found.chosen,
        "units": {name: unit for name, _, _, unit in found.table()},
        "delay_samples": found.delay,
        "trained_samples": found.trained,
        "left_out_samples": found.left_out,
        "train": found.train.to_dict(),
        "held_out": found.held_out.to_dict(),
        "straight_line": {
            "model": found.line.to_dict(),
            "train": found.line_train.to_dict(),
            "held_out": found.line_held_out.to_dict(),
        },
        "notes": list(found.notes),
        "advice": list(found.advice),
    }
