"""Tables and numbers of the page `controller`, from docs/data/controller.json and target.json.

The figure is drawn by python docs/controller_page.py
"""

from page_parts import DOCS, Document, of_all, percent, read, replacements, table_of

from piezoest._files import save_figure
from piezoest._tables import Columns
from piezoest.bench.figures import new_figure

NEAR = 0.01  # relative difference of settled errors
SOURCES = ("controller", "target")
PARITY: Columns = {
    "scenario": "scenario",
    "estimator": "estimator",
    "samples": lambda row: f"{row['samples']:,}".replace(",", "\N{NO-BREAK SPACE}"),
    "difference, double": lambda row: f"{row['double_difference']:.1e}",
    "settled error [nm]": lambda row: f"{1e3 * row['settled_error_um']:.2f}",
    "in float [nm]": lambda row: f"{1e3 * row['settled_error_float_um']:.2f}",
    "change": lambda row: percent(row["float_difference"]),
}
TARGET: Columns = {
    "controller": "controller", "numbers": "precision", "instructions, mean": "instructions_mean",
    "largest": "instructions_largest", "cycles, mean": "cycles_mean", "cycles, largest": "cycles_largest",
    "of a 50 kHz sample": lambda row: f"{100.0 * row['load_largest']:.0f} %",
    "flash [B]": "flash_controller", "state [B]": "ram_state", "stack [B]": "stack",
}  # fmt: skip


def pieces(parity: Document, target: Document) -> dict[str, str]:
    runs, loads = parity["rows"], target["rows"]
    least = min(row["load_largest"] for row in loads if row["precision"] == "double")
    numbers = {
        "exact": of_all(sum(row["double_difference"] == 0.0 for row in runs), len(runs)),
        "near": of_all(sum(row["float_difference"] <= NEAR for row in runs), len(runs)),
        "limit": percent(NEAR),
        "double": f"{least:.0f}",
        "tools": "; ".join(target["tools"]),
    }
    return {
        "numbers": replacements("controller", numbers),
        "parity": table_of(
            "Generated C compared with the library; settled error: mean of ten periods' largest errors",
            runs,
            PARITY,
        ),
        "target": table_of("On a Cortex-M4F", loads, TARGET),
    }


def draw() -> None:
    rows = [row for row in read("target")["rows"] if row["precision"] == "float"]
    figure = new_figure(6, 3)
    axes = figure.subplots()
    names = [row["controller"] for row in rows]
    longest, mean = ([100.0 * row[f"load_{name}"] for row in rows] for name in ("largest", "mean"))
    axes.barh(names, longest, color="C0", alpha=0.4, label="longest step")
    axes.barh(names, mean, color="C0", height=0.4, label="mean")
    axes.axvline(50.0, color="0.4", ls="--", lw=1)
    axes.set(xlabel="time of a step [% of a sample at 50 kHz]", xlim=(0, None))
    axes.invert_yaxis()
    axes.legend(loc="lower right")
    save_figure(figure, DOCS / "figures" / "controller" / "load.png", dpi=130)


if __name__ == "__main__":
    draw()
