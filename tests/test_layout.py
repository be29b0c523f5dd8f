"""Layouts: names, what numbers can be, sizes that users choose, and what is absent."""

import copy
import pickle
from typing import Any

import pytest

from piezoest.layout import (
    ABSENT,
    COUNT,
    NUMBER,
    WORK,
    Length,
    Named,
    Record,
    new,
    numbers,
    record,
)

LAW = record(updates=COUNT, theta=numbers(3), P=numbers(3, 3), rates=ABSENT)


def lengthy(plays: int) -> Record:
    """A layout with sizes that users choose, in a record within."""
    memory = record(u=numbers(Length("plays", plays)), thetas=numbers(Length("plays", plays), 2), last=NUMBER)
    return record(memory=memory, law=LAW, work=WORK, level=ABSENT)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(KeyError, match="thetta"):
        new(LAW, thetta=[1.0, 2.0, 3.0])
    with pytest.raises(KeyError, match="updatse"):
        new(lengthy(2), law={"updatse": 1.0})
    with pytest.raises(ValueError, match=r"\['plays'\] are names of fields and of lengths"):
        record(plays=COUNT, u=numbers(Length("plays", 3)))


def test_layouts_are_values() -> None:
    layout = lengthy(4)
    for same in (lengthy(4), copy.deepcopy(layout), pickle.loads(pickle.dumps(layout))):
        assert same == layout
        assert hash(same) == hash(layout)
    others = (lengthy(5), record(**dict(layout.fields[:-1])), Record(layout.fields, "piezoest.layout"))
    assert len({layout, *others}) == 4


def test_named_reads_and_writes_the_array() -> None:
    layout = lengthy(2)
    state = new(layout, work=5.0)
    named: Any = Named(state, layout)
    assert type(named.work) is float
    assert named.level is None
    assert named.law.rates is None
    named.law.theta[1] = 3.0
    named.memory.last = 4.0
    assert state["law"]["theta"][1] == 3.0
    assert state["memory"]["last"] == 4.0
    for misspelt in (lambda: named.law.thetta, lambda: setattr(named.law, "thetta", 1.0)):
        with pytest.raises((ValueError, KeyError, AttributeError), match="thetta"):
            misspelt()
