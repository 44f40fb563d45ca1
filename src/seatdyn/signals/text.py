"""Columns of numbers in a text file, read block by block, so that memory holds the result only.

The separator may be comma, semicolon, tab or blanks; with a separator other than comma a comma is
the decimal point. Lines before the first row of numbers are metadata: the last of them with as many
cells as that row is the header, and it may be followed by a row of units. Empty cells at the end of
a row are dropped.
"""

from __future__ import annotations

import itertools
import re
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seatdyn.errors import MeasurementError
from seatdyn.units import suggestion

Array = NDArray[np.float64]

BLOCK = 16_384  # lines read at once
LOOKED_AT = 200  # lines within which the first row of numbers must come
COMMENT = ("#", "%", "//")
SEPARATORS = (";", "\t", ",", None)  # None: blanks
# what a cell or a bracket must hold to be taken for a unit
UNITS_WRITTEN = frozenset(
    [
        *("", "-", "1", "%", "s", "sec", "ms", "min", "h", "hz", "v", "mv", "n", "m", "mm", "m/s"),
        *("mm/s", "mm/s2", "m/s2", "m/s²", "m/s^2", "ms-2", "m/s/s", "g", "mg"),
    ]
)
# a header like "acc_z [m/s2]" or "Zeit (s)"
NAME_AND_UNIT = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\])]*)[\])]$")
DECIMAL_COMMA = re.compile(r"^[+-]?\d+,\d+([eE][+-]?\d+)?$")
# what is left of a decimal comma behind a separator, as of "0,052"; whole numbers do not begin so
DECIMALS = re.compile(r"^0\d+$")
LARGEST_SHOWN = 40  # characters of a wrong cell


@dataclass(frozen=True)
class Layout:
    """How a text file is laid out, found from its first lines.

    Parameters
    ----------
    names : of the columns without unit; "1", "2", ... where the file has no header
    units : of the columns as written, "" where there is none
    numeric : whether the first row has a number there
    separator : between cells, None for blanks
    decimal_comma : whether a comma is the decimal point
    first_row : line number of the first row of numbers, from 1
    encoding : of the file
    has_header : whether `names` are from the file
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    numeric: tuple[bool, ...]
    separator: str | None
    decimal_comma: bool
    first_row: int
    encoding: str
    has_header: bool

    def cells(self, line: str) -> list[str]:
        """Cells of one line, without blanks and quotes around them."""
        return _cells(line, self.separator)

    def is_number(self, cell: str) -> bool:
        """Whether a cell holds a number; NaN counts, and is refused with its line later."""
        return _is_number(cell, self.decimal_comma)

    def index(self, column: str | int, source: str) -> int:
        """Place of a column given by name, by name with unit, or by number from 1."""
        text = str(column)
        full = [f"{n} [{u}]" if u else n for n, u in zip(self.names, self.units, strict=True)]
        for known in (list(self.names), full):
            if known.count(text) > 1:
                raise MeasurementError(
                    f"{source} has {known.count(text)} columns {text!r}; give the number of the "
                    f"column, 1 .. {len(known)}."
                )
            if text in known:
                return known.index(text)
        if text.isdigit() and 1 <= int(text) <= len(self.names):
            return int(text) - 1
        if not self.has_header:
            raise MeasurementError(
                f"{source} has no header, and so no column {text!r}; give the number of the "
                f"column, 1 .. {len(self.names)}."
            )
        raise MeasurementError(
            f"{source} has no column {text!r}. {suggestion(text, [n for n in self.names if n])}"
        )


@dataclass
class Columns:
    """Columns read from a text file.

    Parameters
    ----------
    values : (sample, column)
    first_row : line number of the first sample
    skipped : line numbers of empty lines and comments after it
    """

    values: Array
    first_row: int
    skipped: list[int] = field(default_factory=list)

    def line(self, sample: int) -> str:
        """Place of a sample, "line 17"."""
        line = self.first_row + sample
        for empty in self.skipped:
            line += empty <= line
        return f"line {line}"


def find_layout(path: Path) -> Layout:
    """Separator, header, units and first row of numbers of a text file.

    Raises
    ------
    MeasurementError
        An empty file, one that is no text, or without a row of numbers near its beginning.
    """
    source = repr(str(path))
    encoding = _encoding(path)
    with path.open(encoding=encoding, errors="replace") as file:
        lines = list(itertools.islice(file, LOOKED_AT))
    if not any(line.strip() for line in lines):
        raise MeasurementError(f"{source} is empty; was the measurement stored?")
    if any("\0" in line for line in lines):
        raise MeasurementError(
            f"{source} is not a text file; give it the suffix of its format, or export it as CSV."
        )
    for all_numbers in (True, False):  # a column of dates or remarks is allowed for
        for separator in SEPARATORS:
            rows = [_cells(line, separator) for line in lines]
            count = statistics.mode(len(row) for row in rows if row)
            if count < 2 and separator is not None:
                continue
            for place, row in enumerate(rows):
                if len(row) != count:
                    continue
                comma = separator != "," and any(
                    DECIMAL_COMMA.match(cell) for other in rows[place:] for cell in other
                )
                numeric = tuple(_is_number(cell, comma) for cell in row)
                if all(numeric) or (any(numeric) and not all_numbers):
                    if separator == ",":
                        _refuse_two_meanings(rows[place:], place + 1, source)
                    names = tuple(str(i) for i in range(1, count + 1))
                    bare = Layout(
                        names, ("",) * count, numeric, separator, comma, place + 1, encoding, False
                    )
                    return _with_header(bare, lines[:place])
    shown = [line.strip() for line in lines if line.strip()]
    if len(shown) == 1:
        raise MeasurementError(f"{source} has a header and no samples.")
    raise MeasurementError(
        f"{source} has no row of numbers in its first {len(lines)} lines; line 2 is "
        f"{shown[1][:LARGEST_SHOWN]!r}. A row must hold numbers only, separated by comma, "
        "semicolon, tab or blanks."
    )


def _refuse_two_meanings(rows: Sequence[Sequence[str]], first: int, source: str) -> None:
    """Refuse commas that are decimal points too: every number would be read as two."""
    for n, row in enumerate(rows, first):
        # a point anywhere is the decimal point
        if any(DECIMALS.match(cell) for cell in row) and not any("." in cell for cell in row):
            raise MeasurementError(
                f"{source}, line {n}: {','.join(row)[:LARGEST_SHOWN]!r} has commas for decimal "
                "points, and no other separator between its columns. Export the file with decimal "
                "points, or with semicolons between the columns."
            )


def _with_header(bare: Layout, above: Sequence[str]) -> Layout:
    """Layout with the names and units that stand above the first row of numbers."""
    count = len(bare.names)
    rows = [(n, bare.cells(line.lstrip("#%/ "))) for n, line in enumerate(above, 1)]
    rows = [(n, row) for n, row in rows if len(row) == count]
    # a row with a number in it is no header, but one of the samples with something wrong
    headers = [n for n, row in rows if not any(bare.is_number(cell) for cell in row)]
    if not headers:
        return replace(bare, first_row=rows[0][0]) if rows else bare
    texts = dict(rows)
    last = headers[-1]
    with_units = len(headers) > 1 and all(
        cell.strip("[]() ").lower() in UNITS_WRITTEN for cell in texts[last]
    )
    names = list(texts[headers[-2] if with_units else last])
    units = [cell.strip("[]() ") if with_units else "" for cell in texts[last]]
    for i, name in enumerate(names):
        match = NAME_AND_UNIT.match(name)
        if match and match["unit"].strip().lower() in UNITS_WRITTEN:
            names[i], units[i] = match["name"], match["unit"].strip()
    return replace(
        bare, names=tuple(names), units=tuple(units), first_row=last + 1, has_header=True
    )


def _cells(line: str, separator: str | None) -> list[str]:
    """Cells of a line, without blanks and quotes around them, and without empty ones at its end."""
    cells = [cell.strip().strip('"').strip() for cell in line.strip().split(separator)]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _encoding(path: Path) -> str:
    with path.open("rb") as file:
        head = file.read(65_536)
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        # the block may end inside a character of up to four bytes
        (head[:-4] if len(head) == 65_536 else head).decode("utf-8-sig")
    except UnicodeDecodeError:
        return "cp1252"  # what instruments under Windows write
    return "utf-8-sig"


def read_columns(path: Path, layout: Layout, wanted: Sequence[int], most: int) -> Columns:
    """Numbers of some columns.

    Parameters
    ----------
    wanted : places of the columns, from 0
    most : largest number of samples

    Raises
    ------
    MeasurementError
        A cell that is missing or no number, a row that is too short, or too many samples; the
        message names the line.
    """
    blocks: list[Array] = []
    columns = Columns(np.zeros((0, len(wanted))), layout.first_row)
    count = 0
    with path.open(encoding=layout.encoding, errors="replace") as file:
        numbered = enumerate(itertools.islice(file, layout.first_row - 1, None), layout.first_row)
        for lines in _blocks(numbered, columns.skipped):
            count += len(lines)
            if count > most:
                raise MeasurementError(
                    f"{str(path)!r} has more than {most} samples; cut it into shorter records, or "
                    "reduce its rate."
                )
            blocks.append(_numbers(path, layout, lines, wanted))
    if not blocks:
        raise MeasurementError(f"{str(path)!r} has a header and no samples.")
    columns.values = np.concatenate(blocks)
    return columns


def _blocks(
    numbered: Iterator[tuple[int, str]], skipped: list[int]
) -> Iterator[list[tuple[int, str]]]:
    """Lines with their numbers, without empty ones and comments."""
    while read := list(itertools.islice(numbered, BLOCK)):
        kept = []
        for n, line in read:
            text = line.strip()
            if text and not text.startswith(COMMENT):
                kept.append((n, line))
            else:
                skipped.append(n)
        if kept:
            yield kept


def _numbers(
    path: Path, layout: Layout, lines: list[tuple[int, str]], wanted: Sequence[int]
) -> Array:
    """One block as numbers; numpy reads it, and only where it cannot, we look for the reason."""
    text = [line.replace(",", ".") if layout.decimal_comma else line for _, line in lines]
    try:
        _require_width(text, layout)
        values = np.loadtxt(
            text, delimiter=layout.separator, usecols=wanted, ndmin=2, comments=None, quotechar='"'
        )
    except ValueError:
        values = _slowly(path, layout, lines, wanted)
    bad = ~np.isfinite(values)
    if np.any(bad):
        row, column = np.argwhere(bad)[0]
        name = layout.names[wanted[column]]
        raise MeasurementError(
            f"{str(path)!r}, line {lines[row][0]}, column {name!r}: {values[row, column]} is no "
            "sample. The instrument lost it; cut the record there."
        )
    return values


def _require_width(text: Sequence[str], layout: Layout) -> None:
    """Send rows that look too long to `_slowly`: numpy would take the wrong cells of them."""
    most, separator = len(layout.names), layout.separator
    for line in text:
        # counting separators is quicker than splitting, and enough unless cells are quoted
        cells = (
            len(line.split())
            if separator is None
            else line.rstrip(f"{separator} \r\n").count(separator) + 1
        )
        if cells > most:
            raise ValueError("look at every cell")


def _slowly(
    path: Path, layout: Layout, lines: list[tuple[int, str]], wanted: Sequence[int]
) -> Array:
    """Cell by cell; the first that is wrong is named."""
    rows = []
    for n, line in lines:
        where = f"{str(path)!r}, line {n}"
        cells = layout.cells(line)
        if len(cells) <= max(wanted):
            raise MeasurementError(
                f"{where} has {len(cells)} cells; the columns asked for need {max(wanted) + 1}. "
                "The file may be cut off, or the separator wrong; repair or remove the line."
            )
        if len(cells) > len(layout.names):
            raise MeasurementError(
                f"{where} has {len(cells)} cells, other lines have {len(layout.names)}; which of "
                "them belong to which column is open. Repair or remove the line."
            )
        row = []
        for place in wanted:
            cell, name = cells[place], layout.names[place]
            if not cell:
                raise MeasurementError(
                    f"{where}, column {name!r} is empty: a sample is missing. Cut the record there."
                )
            if not layout.is_number(cell):
                raise MeasurementError(
                    f"{where}, column {name!r}: {cell[:LARGEST_SHOWN]!r} is not a number. Repair "
                    "the line or cut the record there."
                )
            row.append(float(cell.replace(",", ".") if layout.decimal_comma else cell))
        rows.append(row)
    return np.array(rows)


def _is_number(cell: str, decimal_comma: bool) -> bool:
    """Whether a cell holds a number; NaN counts, and is refused with its line later."""
    try:
        float(cell.replace(",", ".") if decimal_comma else cell)
    except ValueError:
        return False
    return "_" not in cell
