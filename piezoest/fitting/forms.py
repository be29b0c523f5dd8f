"""Kinds of models that a record can be fitted with."""

from typing import NamedTuple


class Form(NamedTuple):
    """One kind: what it is called, whether it has plays, a loop, bends and creep."""

    label: str
    plays: bool = False
    loop: bool = False
    bends: bool = False
    creep: bool = False


#: Kinds by name, from the simplest to the richest.
FORMS: dict[str, Form] = {
    "line": Form("straight line"),
    "coleman-hodgdon": Form("Coleman-Hodgdon", loop=True),
    "plays": Form("plays", plays=True),
    "plays-creep": Form("plays, creep", plays=True, creep=True),
    "plays-asymmetric": Form("plays, asymmetric", plays=True, bends=True),
    "plays-asymmetric-creep": Form("plays, asymmetric, creep", plays=True, bends=True, creep=True),
}
