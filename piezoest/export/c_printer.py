"""Statements of C, with declarations placed where the names are first needed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from piezoest.export.c_values import Root


@dataclass
class Line:
    """One statement; `defines` the local whose whole value it sets, `pure` if it does nothing else."""

    text: str
    uses: frozenset[str] = frozenset()
    defines: str | None = None
    pure: bool = False
    comment: list[str] = field(default_factory=list)
    pointer: Root | None = None  # of a definition of a pointer


@dataclass
class Block:
    """A statement with statements inside: if, for, while."""

    head: str
    uses: frozenset[str]
    body: list[Statement]
    orelse: list[Statement] = field(default_factory=list)
    loop: bool = False
    own: str | None = None  # loop variable, declared in the head
    comment: list[str] = field(default_factory=list)


Statement = Line | Block


def mentions(statement: Statement, name: str) -> bool:
    """Whether a local is read or set in a statement."""
    if isinstance(statement, Line):
        return name in statement.uses or statement.defines == name
    if statement.own == name:
        return False
    return (
        name in statement.uses
        or any(mentions(inner, name) for inner in statement.body)
        or any(mentions(inner, name) for inner in statement.orelse)
    )


def _walk(statements: list[Statement]) -> Iterator[Statement]:
    for statement in statements:
        yield statement
        if isinstance(statement, Block):
            yield from _walk(statement.body)
            yield from _walk(statement.orelse)


def used_names(statements: list[Statement]) -> set[str]:
    """Names whose values matter."""
    return {name for statement in _walk(statements) for name in statement.uses}


def drop_unused(statements: list[Statement]) -> list[Statement]:
    """Leave out what sets a local that nothing reads, and what is then empty."""
    while True:
        used = used_names(statements)
        shorter = _without(statements, used)
        if shorter == statements:
            return statements
        statements = shorter


def _without(statements: list[Statement], used: set[str]) -> list[Statement]:
    kept: list[Statement] = []
    for statement in statements:
        if isinstance(statement, Line):
            idle = statement.defines is not None and statement.defines not in used
            if idle and not statement.pure:
                # The call is for its effect alone.
                text = statement.text.split(" = ", 1)[1]
                kept.append(Line(text, statement.uses, comment=statement.comment))
            elif not idle:
                kept.append(statement)
            continue
        body, orelse = _without(statement.body, used), _without(statement.orelse, used)
        if body or orelse:
            parts = {**vars(statement), "body": body, "orelse": orelse}
            kept.append(Block(**parts))
    return kept


def declare(statements: list[Statement], types: dict[str, str]) -> None:
    """Turn first assignments into declarations, as far inside as all mentions of a name allow."""
    for name, kind in types.items():
        _declare_one(statements, name, kind)


def _declare_one(statements: list[Statement], name: str, kind: str) -> None:
    places = [i for i, statement in enumerate(statements) if mentions(statement, name)]
    if not places:
        return
    first = statements[places[0]]
    if isinstance(first, Block) and len(places) == 1 and name not in first.uses:
        inside = [part for part in (first.body, first.orelse) if any(mentions(inner, name) for inner in part)]
        # In a loop only what each turn sets before anything reads it.
        if len(inside) == 1 and (not first.loop or _sets_first(inside[0], name)):
            _declare_one(inside[0], name, kind)
            return
    if isinstance(first, Line) and first.defines == name and name not in first.uses:
        # An array's statement is its declaration already.
        first.text = first.text if kind.endswith("]") else f"{kind}{_gap(kind)}{first.text}"
        return
    statements.insert(places[0], Line(f"{kind}{_gap(kind)}{name};"))


def _gap(kind: str) -> str:
    return "" if kind.endswith("*") else " "


def _sets_first(statements: list[Statement], name: str) -> bool:
    first = next(statement for statement in statements if mentions(statement, name))
    if isinstance(first, Line):
        return first.defines == name and name not in first.uses
    return False


def print_statements(statements: list[Statement], indent: int) -> list[str]:
    """Lines of C."""
    pad = "    " * indent
    lines: list[str] = []
    for statement in statements:
        if statement.comment:
            lines += _comment(statement.comment, pad)
        if isinstance(statement, Line):
            lines.append(f"{pad}{statement.text}")
            continue
        body, orelse, head = statement.body, statement.orelse, statement.head
        lines.append(f"{pad}{head} {{")
        lines += print_statements(body, indent + 1)
        if orelse:
            only = orelse[0]
            if len(orelse) == 1 and isinstance(only, Block) and not only.loop and not only.comment:
                rest = print_statements(orelse, indent)
                lines.append(f"{pad}}} else {rest[0].lstrip()}")
                lines += rest[1:]
                continue
            lines.append(f"{pad}}} else {{")
            lines += print_statements(orelse, indent + 1)
        lines.append(f"{pad}}}")
    return lines


def _comment(text: list[str], pad: str) -> list[str]:
    if len(text) == 1:
        return [f"{pad}/* {text[0]} */"]
    return [f"{pad}/* {text[0]}", *(f"{pad} * {line}" for line in text[1:-1]), f"{pad} * {text[-1]} */"]
