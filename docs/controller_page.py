"""Tables and numbers of the page `controller`, from docs/data/controller.json and target.json."""

from page_parts import Document, of_all, percent, replacements, table_of

from piezoest._tables import Columns

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
    }
    emulated = replacements("target", {"tools": "; ".join(target["tools"])}, target)
    return {
        "numbers": replacements("controller", numbers, parity) + emulated,
        "parity": table_of(
            "Generated C compared with the library; settled error: mean of ten periods' largest errors",
            runs,
            PARITY,
        ),
        "target": table_of("On a Cortex-M4F", loads, TARGET),
    }
