"""Statements of C, with declarations placed where the names are first needed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace


@dataclass
class Statement:
    """One statement, or the head of an if, for or while, and what stands inside.

    `defines` is the local whose whole value it sets, `pure` if it does nothing else.
    """

    text: str
    uses: frozenset[str] = frozenset()
    defines: str | None = None
    pure: bool = False
    body: list[Statement] = field(default_factory=list)
    orelse: list[Statement] = field(default_factory=list)
    loop: bool = False
    own: str | None = None  # loop variable, declared in the head
    comment: list[str] = field(default_factory=list)

    @property
    def inside(self) -> list[Statement]:
        """All statements right inside."""
        return [*self.body, *self.orelse]


def mentions(statement: Statement, name: str) -> bool:
    """Whether a local is read or set in a statement."""
    if statement.own == name:
        return False
    here = name in statement.uses or statement.defines == name
    return here or any(mentions(inner, name) for inner in statement.inside)


def used_names(statements: list[Statement]) -> set[str]:
    """Names whose values matter."""
    return {name for each in statements for name in each.uses | used_names(each.inside)}


def drop_unused(statements: list[Statement]) -> list[Statement]:
    """Leave out what sets a local that nothing reads, and what is then empty."""
    while True:
        shorter = _without(statements, used_names(statements))
        if shorter == statements:
            return statements
        statements = shorter


def _without(statements: list[Statement], used: set[str]) -> list[Statement]:
    kept: list[Statement] = []
    for statement in statements:
        idle = statement.defines is not None and statement.defines not in used
        if idle and not statement.pure:
            # The call is for its effect alone.
            statement = replace(statement, text=statement.text.split(" = ", 1)[1], defines=None)
        elif idle:
            continue
        if statement.inside:
            body, orelse = _without(statement.body, used), _without(statement.orelse, used)
            if not body and not orelse:
                continue
            statement = replace(statement, body=body, orelse=orelse)
        kept.append(statement)
    return kept


def declare(statements: list[Statement], name: str, kind: str) -> None:
    """Declare a local, at its first assignment and as far inside as all mentions of it allow.

    A local without a `kind` is an array: its statement is its declaration.
    """
    places = [i for i, statement in enumerate(statements) if mentions(statement, name)]
    if not places:
        return
    first = statements[places[0]]
    if len(places) == 1 and first.inside and name not in first.uses:
        inside = [
            block for block in (first.body, first.orelse) if any(mentions(inner, name) for inner in block)
        ]
        # In a loop only what each turn sets before anything reads it.
        if len(inside) == 1 and (not first.loop or _sets_first(inside[0], name)):
            declare(inside[0], name, kind)
            return
    if first.defines == name and name not in first.uses:
        first.text = f"{kind} {first.text}" if kind else first.text
        return
    statements.insert(places[0], Statement(f"{kind} {name};"))


def _sets_first(statements: list[Statement], name: str) -> bool:
    first, *others = [statement for statement in statements if mentions(statement, name)]
    if name in first.uses:
        return False
    # Here, or all within one inner block that sets it first.
    alone = not others and not any(mentions(inner, name) for inner in first.orelse)
    return first.defines == name or (alone and _sets_first(first.body, name))


def print_statements(statements: list[Statement], indent: int) -> list[str]:
    """Lines of C."""
    pad = "    " * indent
    lines: list[str] = []
    for statement in statements:
        lines += comment(statement.comment, pad)
        if not statement.inside:
            lines.append(f"{pad}{statement.text}")
            continue
        lines += [f"{pad}{statement.text} {{", *print_statements(statement.body, indent + 1)]
        if statement.orelse:
            only = statement.orelse[0]
            rest = print_statements(statement.orelse, indent)
            if len(statement.orelse) == 1 and only.text.startswith("if ") and not only.comment:
                lines += [f"{pad}}} else {rest[0].lstrip()}", *rest[1:]]
                continue
            lines += [f"{pad}}} else {{", *(f"    {line}" for line in rest)]
        lines.append(f"{pad}}}")
    return lines


def comment(text: list[str], pad: str = "") -> list[str]:
    """Lines of a comment."""
    if not text:
        return []
    lines = [f"{pad}/* {text[0]}", *(f"{pad} * {line}".rstrip() for line in text[1:])]
    return [*lines[:-1], f"{lines[-1]} */"]
