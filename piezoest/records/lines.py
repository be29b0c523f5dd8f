"""Lines of a text file, packed or not, in chunks: encoding, comments and blank lines."""

from __future__ import annotations

import bz2
import codecs
import contextlib
import gzip
import io
import lzma
import re
import zlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from piezoest.records.comments import COMMENT, is_comment
from piezoest.records.source import LogError, check_size

# Bytes for recognising the encoding.
HEAD_BYTES = 1 << 16
# Characters of a line; more are no row of a log, and would fill the memory.
LONGEST_LINE = 1 << 20
# Bytes that are read at a time, at least and at most, and about those of a row.
FEWEST_BYTES, MOST_BYTES, BYTES_OF_A_ROW = 1 << 14, 1 << 20, 32
# Lines that a program writes behind the last row, at most.
LONGEST_FOOTER, LONGEST_MEANS = 20, 4
# Characters that no text has, unless as UTF-16.
CONTROL = frozenset(range(32)) - frozenset(b"\t\n\v\f\r\x1a\x1b")
UTF_16 = (b"\xff\xfe", b"\xfe\xff")
UTF_32 = (b"\xff\xfe\0\0", b"\0\0\xfe\xff")
UNMARKED = {"utf-16-le": 1, "utf-16-be": 0}  # and which byte of two is zero in Latin letters
PACKED: dict[bytes, Callable[[Any], Any]] = {
    b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zXZ\0": lzma.open
}  # fmt: skip
# Spreadsheets write a blank line as marks alone.
BLANK = " \t\r\v\f,;|"
# A line that is blank or a comment, in a text that begins with the end of a line.
SPECIAL = re.compile(rf"\n[^\S\n]*(?:{COMMENT}|[,;|\s]*(?:\n|\Z))")


class Lines(NamedTuple):
    """Consecutive lines with samples."""

    numbers: np.ndarray[Any, np.dtype[np.int64]]  # (n,): of the lines, from 1
    text: str  # the n lines; a blank one is a sample that was lost
    done: int  # bytes of the file that are read by then

    @classmethod
    def of(cls, kept: list[tuple[int, str]], done: int) -> Lines:
        """Lines of their numbers and texts."""
        return cls(np.array([number for number, _ in kept]), "\n".join(line for _, line in kept), done)

    @classmethod
    def all(cls, first: int, text: str, done: int) -> Lines:
        """All lines of a text."""
        return cls(np.arange(first, first + text.count("\n") + 1), text, done)

    def __add__(self, other: Any) -> Lines:
        """Lines with those behind them."""
        return Lines(np.append(self.numbers, other.numbers), f"{self.text}\n{other.text}", other.done)

    def split(self, last: int) -> tuple[Lines, Lines]:
        """All but the last lines, and these."""
        before, *behind = self.text.rsplit("\n", last)
        first = Lines(self.numbers[:-last], before, self.done)
        return first, Lines(self.numbers[-last:], "\n".join(behind), self.done)


def unpacking(start: bytes) -> Callable[[Any], Any] | None:
    """What unpacks a file that begins so; None if it is not packed."""
    return next((unpack for mark, unpack in PACKED.items() if start.startswith(mark)), None)


@contextlib.contextmanager
def unpacked(path: Path) -> Iterator[tuple[BinaryIO, BinaryIO]]:
    """Open a file: as it is, whose position says how much is read, and what is in it if it is packed."""
    with path.open("rb") as raw:
        unpack = unpacking(raw.read(6))
        raw.seek(0)
        try:
            yield raw, raw if unpack is None else unpack(raw)
        except (OSError, EOFError, zlib.error, lzma.LZMAError) as error:
            if unpack is None:
                raise
            raise LogError(f"{path}: cannot be unpacked, it may be truncated: {error}") from None


def beginning(path: Path, size: int) -> bytes:
    """First bytes of a file, or of what is packed in it."""
    with unpacked(path) as (_, file):
        return file.read(size)


def encoding_of(path: Path) -> str:
    """Encoding by which the file can be read; ValueError if it is not a text."""
    raw = beginning(path, HEAD_BYTES)
    if raw.startswith(UTF_32):
        return "utf-32"
    if raw.startswith(UTF_16):
        return "utf-16"
    for encoding, zeros in UNMARKED.items():
        # Nearly all letters and digits have a zero beside them.
        if raw[zeros::2].count(0) > 0.9 * len(raw) / 2 and CONTROL.isdisjoint(raw[1 - zeros :: 2]):
            return encoding
    # What a computer had not yet written when it lost its power is zero.
    if CONTROL.intersection(raw[:4096].rstrip(b"\0") or raw[:4096]):
        raise LogError(
            f"{path}: this is not a text file: save the log as CSV, or name it by its format "
            "(.mat, .h5, .parquet, .tdms, .xlsx, .npy, .npz)"
        )
    try:
        # The last character may be cut in two.
        codecs.getincrementaldecoder("utf-8")().decode(raw)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def check_table(path: Path, first: str) -> None:
    """Refuse a text whose first line, without blanks at its ends, is that of no table."""
    kinds = {"{": "JSON", "[{": "JSON", "[[": "JSON", "<": "HTML or XML"}
    kind = next((kind for sign, kind in kinds.items() if first.startswith(sign)), "")
    if kind:
        raise LogError(f"{path}: this is {kind}, no table: save the log as CSV")


def chunks(path: Path, encoding: str, rows: int) -> Iterator[tuple[int, str, int]]:
    """Whole lines, of about so many rows at most: number of the first, text, bytes read so far."""
    size = min(max(BYTES_OF_A_ROW * rows, FEWEST_BYTES), MOST_BYTES)
    decoder = io.IncrementalNewlineDecoder(codecs.getincrementaldecoder(encoding)(errors="replace"), True)
    number, rest, held, data = 1, "", 0, b"first"
    with unpacked(path) as (raw, file):
        while data:
            data = file.read(size)
            held += len(data)
            check_size(path, held)
            text = rest + decoder.decode(data, final=not data)
            cut = text.rfind("\n") + 1 if data else len(text)
            whole, rest = text[:cut], text[cut:]
            if whole:
                yield number, whole.removesuffix("\n"), raw.tell()
            number += whole.count("\n")
            if len(rest) >= LONGEST_LINE:
                raise LogError(f"{path}, line {number}: more than {LONGEST_LINE} characters: this is no log")


def sample_lines(
    path: Path,
    encoding: str,
    begins: int,
    skip_blank: bool,
    rows: int,
    left_out: Callable[[int, str], object] = lambda number, line: None,
) -> Iterator[Lines]:
    """Lines with samples, from the line `begins` on; a blank one is a sample if another follows it.

    `left_out` is told number and text of each comment between them.
    """
    blank: list[tuple[int, str]] = []
    for first, text, done in chunks(path, encoding, rows):
        if first >= begins and not blank and not SPECIAL.search("\n" + text):
            yield Lines.all(first, text, done)
            continue
        kept: list[tuple[int, str]] = []
        for number, line in enumerate(text.split("\n"), first):
            if number < begins:
                continue
            if is_comment(line):
                left_out(number, line)
                continue
            if line.strip(BLANK):
                kept += [*blank, (number, line)]
                blank.clear()
            elif not skip_blank or line.strip():
                blank.append((number, ""))
        if kept:
            yield Lines.of(kept, done)


def end_of_rows(lines: list[str], is_row: Callable[[str], bool]) -> int:
    """Number of lines up to the last row: those behind it are a footer; zero if none is a row."""
    return next((k for k in range(len(lines), 0, -1) if lines[k - 1].strip() and is_row(lines[k - 1])), 0)


def without_footer(
    blocks: Iterable[Lines],
    is_row: Callable[[str], bool],
    begun: Callable[[str], bool],
    left_out: Callable[[int, str], object],
) -> Iterator[Lines]:
    """Lines but a few behind the last row, of which `left_out` is told the number and text of the first.

    Where the first line is no row either, rows cannot be told from other lines, and all are left. Lines whose
    first cell is empty are no rows where all others have one: means stand below the columns so.
    """
    held: Lines | None = None
    known = False
    for block in blocks:
        known = known or (held is None and is_row(block.text.partition("\n")[0]))
        held = block if held is None else held + block
        if held.numbers.size > 2 * LONGEST_FOOTER:
            done, held = held.split(LONGEST_FOOTER)
            yield done
    if held is None:
        return
    lines = held.text.split("\n")
    kept = end_of_rows(lines, is_row)
    empty = [k for k in range(kept) if lines[k].strip() and not begun(lines[k])]
    if 0 < len(empty) <= LONGEST_MEANS and empty[0] == kept - len(empty) > 0:
        kept = empty[0]
    footer = [k for k in range(kept, len(lines)) if lines[k].strip()]
    if known and 0 < len(footer) <= LONGEST_FOOTER:
        left_out(int(held.numbers[footer[0]]), lines[footer[0]])
        held = Lines(held.numbers[:kept], "\n".join(lines[:kept]), held.done)
    if held.numbers.size:
        yield held
