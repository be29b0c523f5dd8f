"""A model's parts as columns of a linear regression, made block by block along a record.

x = sum_i w_i column_i: everything in which a model is linear stands in one matrix, of which only sums over
the record are kept. So a long record takes no more memory than a short one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from piezoest._checks import FloatArray
from piezoest.compile import Matrix, Vector, compiled
from piezoest.fitting.rows import times
from piezoest.models import Creep, Model

# Rows that are made at once.
CHUNK = 8192
# After so many time constants nothing is left.
LONG_AGO = 60.0
# Behind the record that was fitted a drift goes on as creep does, with the logarithm of time, at first with
# this fraction of its rate: what warms up or creeps becomes slower.
SLOWER = 0.6
NO_CREEP = Creep(np.empty(0), np.empty(0))


class Basis(Protocol):
    """Columns of one kind of model.

    No creep follows the `free` ones.
    """

    @property
    def size(self) -> int:
        """How many."""

    @property
    def free(self) -> int:
        """How many of them, at the end, say where the stage was before the record."""

    @property
    def foretells(self) -> bool:
        """Whether the model says by itself how a stage goes on beyond the voltages of the record."""

    @property
    def bent(self) -> bool:
        """Whether equal loops elsewhere may have another shape."""

    def begin(self) -> Any:
        """State before the first sample."""

    def afresh(self, u: float) -> Basis:
        """The same for a stage that rests at 0 V until a record begins at voltage u [V]."""

    def rows(self, u: FloatArray, state: Any) -> FloatArray:
        """Columns (N, size) along a voltage; `state` goes on."""

    def lower(self, gain: float) -> FloatArray:
        """Least coefficients (size,), where a straight line has that gain [µm/V]."""

    def line(self) -> FloatArray:
        """Coefficients (size,) that make a straight line of 1 µm/V."""

    def unevenness(self) -> FloatArray:
        """Penalty (size, size) on coefficients that a smooth model does not have, for 1 µm²."""

    def prior(self) -> FloatArray:
        """Penalty (size, size) on what the record hardly shows, whatever else is to be smooth, for 1 µm²."""

    def beyond(self, w: FloatArray) -> tuple[Basis, FloatArray, float]:
        """Columns and coefficients that go on beyond the record, and what that adds within it [µm]."""

    def model(self, w: FloatArray, offset: float, creep: Creep | None, rate: float) -> Model:
        """Model of coefficients (size,)."""

    def initial_state(self, w: FloatArray, model: Any) -> Any:
        """What that model's `simulate` is to begin with."""

    def names(self, w: FloatArray) -> dict[str, FloatArray]:
        """How the model's parameters that these coefficients give come from them: rows (size,) by name."""


@dataclass(frozen=True, slots=True)
class Design:
    """All columns: the model's, creep gains and creep at the start, offset, drift and jumps."""

    basis: Basis  # the model's own columns
    sample_rate: float  # [Hz]
    samples: int  # length of the record, over which a drift counts by one
    creep: Creep = NO_CREEP  # terms that the model's columns go through, with the gains known so far
    jumps: FloatArray = field(default_factory=lambda: np.empty(0))  # first samples behind the sensor's jumps

    @property
    def terms(self) -> int:
        """Number of creep terms."""
        return int(self.creep.gains.size)

    @property
    def gains(self) -> slice:
        """Columns of the creep gains: what is to be added to those known so far."""
        return slice(self.basis.size, self.basis.size + self.terms)

    @property
    def crept(self) -> slice:
        """Columns of what creep had at the start [µm]."""
        return slice(self.gains.stop, self.gains.stop + self.terms)

    @property
    def offset(self) -> int:
        """Column of the offset; that of the drift is the next, those of the jumps follow."""
        return int(self.crept.stop)

    @property
    def columns(self) -> int:
        """How many there are."""
        return self.offset + 2 + int(self.jumps.size)

    def blocks(self, u: FloatArray, w: FloatArray | None = None) -> Iterator[tuple[slice, FloatArray]]:
        """Rows of all columns along a whole record, some thousand at a time, with their places in it."""
        along = Along(self, w)
        for first in range(0, u.size, CHUNK):
            place = slice(first, min(first + CHUNK, u.size))
            yield place, along.rows(u[place])

    def afresh(self, u: float) -> Design:
        """The same for a stage that rests at 0 V until a record begins at voltage u [V]."""
        return replace(self, basis=self.basis.afresh(u))

    def model(self, w: FloatArray) -> Model:
        """Model of all coefficients (columns,), with its offset and creep."""
        own, creep = w[: self.basis.size], self.creep if self.terms else None
        return self.basis.model(own, float(w[self.offset]), creep, self.sample_rate)

    def output(self, u: FloatArray, w: FloatArray) -> FloatArray:
        """Displacement (N,) of all coefficients (columns,) [µm]."""
        x = np.empty(u.size)
        for place, rows in self.blocks(u, w):
            x[place] = times(rows, w)
        return x


class Along:
    """Rows of a design along a record that comes in parts.

    The model's coefficients, which come first in `w`, make the displacement that drives the creep.
    """

    def __init__(self, design: Design, w: FloatArray | None = None) -> None:
        self._design, self._seen = design, 0
        self._followed = design.basis.size - design.basis.free
        self._w = None if w is None else w[: self._followed]
        self._state = design.basis.begin()
        self._z = np.zeros((design.terms, self._followed + 1))
        self._decays = design.creep.decays(design.sample_rate)

    def rows(self, u: FloatArray) -> FloatArray:
        """Rows (N, columns) of the next samples' voltage."""
        design, followed = self._design, self._followed
        index = np.arange(self._seen, self._seen + u.size)
        self._seen += u.size
        rows = np.empty((u.size, design.columns))
        rows[:, : design.basis.size] = design.basis.rows(u, self._state)
        if design.terms:
            drive = np.zeros(u.size) if self._w is None else times(rows[:, :followed], self._w)
            _add_creep(rows, drive, design.creep.gains, self._decays, self._z, design.gains.start)
            age = (index + 1.0) / design.sample_rate
            past = np.outer(age, 1.0 / design.creep.time_constants)
            # Numbers below the normal range would make all that follows a hundred times slower.
            rows[:, design.crept] = np.where(past < LONG_AGO, np.exp(-np.minimum(past, LONG_AGO)), 0.0)
        rows[:, design.offset] = 1.0
        t = index / design.samples
        beyond = np.maximum(t, 1.0) if self._seen > design.samples else None
        rows[:, design.offset + 1] = t if beyond is None else np.minimum(t, 1.0) + SLOWER * np.log(beyond)
        rows[:, design.offset + 2 :] = index[:, None] >= design.jumps
        return rows


@compiled
def _add_creep(rows: Matrix, drive: Vector, gains: Vector, decays: Vector, z: Matrix, first: int) -> None:
    """Add to each followed column what creep makes of it; from `first` on stands what it makes of `drive`."""
    followed = z.shape[1] - 1
    for k in range(rows.shape[0]):
        for j in range(gains.size):
            rest = 1.0 - decays[j]
            for i in range(followed):
                z[j, i] += rest * (rows[k, i] - z[j, i])
            z[j, followed] += rest * (drive[k] - z[j, followed])
            rows[k, first + j] = z[j, followed]
        for j in range(gains.size):
            for i in range(followed):
                rows[k, i] += gains[j] * z[j, i]
