"""Tables and numbers of the page `tuning`, from docs/data/tuning.json."""

from page_parts import Document, replacements, table_of

TITLES = {
    "memories": "Errors after the gain has fallen by 20 %",
    "noises": "Largest error of the last two periods [nm]",
    "excitation": "Largest error [nm] of a frozen model; the columns are the signals it is used on",
    "delays": "Largest error of the last two periods [nm]",
}


def pieces(document: Document) -> dict[str, str]:
    conditions = document["conditions"]
    numbers = {
        "signal": f"{conditions['amplitude_um']:g} µm at {conditions['frequency_Hz']:g} Hz",
        "rate": f"{conditions['sample_rate_Hz']:g} Hz",
    }
    tables = {name: table_of(title, document[name]) for name, title in TITLES.items()}
    return tables | {"numbers": replacements("tuning", numbers, document)}
