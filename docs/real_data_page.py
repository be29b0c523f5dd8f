"""Tables and numbers of the page `real_data`, from its JSON in docs/data."""

from page_parts import Document, percent, replacements, table_of


def pieces(document: Document) -> dict[str, str]:
    found = document["identify"]
    return {
        "numbers": numbers(document),
        "parameters": table_of(
            f"Model: {found['chosen']}",
            found["table"],
            {
                "parameter": lambda row: row[0],
                "value": lambda row: f"{row[1]:.4g}",
                "standard error": lambda row: f"± {row[2]:.1g}" if row[2] > 0.0 else "—",
                "unit": lambda row: row[3],
            },
            "it has no standard error.",
        ),
        "models": table_of(
            "Error of the simulated displacement [µm rms, last column: largest]",
            found["candidates"],
            {
                "model": lambda row: "▸ " * row["chosen"] + row["label"],
                "parameters": "parameters",
                "blocks": lambda row: f"{row['between_um']:.3f}",
                "ahead": lambda row: f"{row['ahead_um']:.3f}",
                "choice": lambda row: f"{row['cross_validated_um']:.3f}",
                "held out": lambda row: f"{row['held_out']['rms_um']:.3f}",
                "held out, largest": lambda row: f"{row['held_out']['max_um']:.2f}",
            },
        ),
        "advice": "".join(f"- {sentence}\n" for sentence in found["advice"]),
        "reason": f"{found['reason']}\n",
    }


def numbers(document: Document) -> str:
    found, other = document["identify"], document["other"]
    lengths = {
        "held": found["held_out"], "line": found["line_held_out"], "stream": document["stream"]["held_out"],
        "other": other["error"], "other without mean": other["without_mean"],
    }  # fmt: skip
    values = {
        "samples": document["samples"],
        "rate": f"{document['sample_rate_Hz']:g} Hz",
        "voltage": f"{document['voltage_V'][0]:.2g} to {document['voltage_V'][1]:.2g} V",
        "stroke": f"{document['displacement_um']:.0f} µm",
        "noise": f"{found['noise_floor_um']:.2f} µm",
        "interval": f"{found['interval_um']:.2f} µm",
        "covered": percent(found["covered"]),
        "other file": f"``{other['source']}``",
        **{name: f"{each['rms_um']:.2f} µm" for name, each in lengths.items()},
    }
    return replacements("recording", values, document)
