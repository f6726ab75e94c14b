"""Header of a CSV table of measurements: the columns that are read, and their allowed values."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

from analysis.data.csv_line import QuoteError, fields_of
from analysis.data.text_file import TextFile, input_error, parse_number
from instrument.errors import InputError
from instrument.text.quoting import printable


@dataclass(frozen=True, slots=True)
class Column:
    """A column that is read: unit, and allowed values, in words and as limits."""

    name: str
    unit: str
    allowed: str
    low: float = -math.inf
    high: float = math.inf

    def parse(self, text: str) -> float:
        """Parse a number in the column's unit; `ValueError` states the problem and the limits."""
        try:
            value = parse_number(text)
        except ValueError as error:
            raise ValueError(f"{error}; allowed: {self.allowed}{_hint(text)}") from None
        if not self.low <= value <= self.high:
            raise ValueError(f"{text.strip()[:40]} {self.unit}; allowed: {self.allowed}")
        return value


# Far beyond any measurement, but squares and ratios of such values do not overflow.
BRDF = Column("brdf", "1/sr", "-1e15 to 1e15 1/sr", -1e15, 1e15)
U_BRDF = Column("u_brdf", "1/sr", "1e-15 to 1e15 1/sr", 1e-15, 1e15)
NEEDED = (
    Column("theta_i_deg", "deg", "a number from 0 to 90 deg", 0.0, 90.0),
    Column("theta_r_deg", "deg", "a number from -90 to 90 deg", -90.0, 90.0),
    Column("dphi_deg", "deg", "a finite number of deg"),
    BRDF,
)
COLUMNS = (*NEEDED, U_BRDF)

HEADER = "a header with theta_i_deg, theta_r_deg, dphi_deg, brdf and, where known, u_brdf"
ROWS = "a row for each geometry"
MAX_COLUMNS = 1000
_SEPARATORS = {";": "';'", "\t": "tabs", " ": "spaces"}
_DECIMAL_COMMA = re.compile(r"([-+]?[0-9]+),([0-9]+)")


@dataclass(frozen=True, slots=True)
class Header:
    """Line number of the header, number of its columns, and index of each column by name."""

    line: int
    width: int
    indices: dict[str, int]


def read_header(file: TextFile, rows: Iterator[tuple[int, str]]) -> Header:
    """Read the header, the first of the file's rows; missing and duplicate columns are noted.

    Raises `InputError` if there is no row, or its fields cannot be separated.
    """
    line, text = next(rows, (0, ""))
    if line == 0:
        raise _refused(file, 1, 1, f"the file is empty; allowed: {HEADER}, and {ROWS}")
    if text.count(",") >= MAX_COLUMNS:
        what = f"header: {text.count(',') + 1} columns; allowed: {MAX_COLUMNS}"
        raise _refused(file, line, 1, what)
    try:
        fields = list(fields_of(text))
    except QuoteError as error:
        raise _refused(file, line, error.column, f"header: {error}") from None
    names = [name.strip() for _, name in fields]
    separator = _other_separator(text, names)
    if separator is not None:
        what = f"header: fields are separated by {_SEPARATORS[separator]}: use commas"
        what += ", and a point in decimal numbers"
        raise _refused(file, line, text.index(separator) + 1, what)
    _check_names(file, line, names, [start for start, _ in fields])
    indices = {c.name: names.index(c.name) for c in COLUMNS if c.name in names}
    return Header(line, len(names), indices)


def _refused(file: TextFile, line: int, column: int, text: str) -> InputError:
    file.note(line, column, text)
    return input_error(file)


def _other_separator(text: str, names: list[str]) -> str | None:
    """Separator of the names other than the comma; None if it is the comma, or not known."""
    needed = {column.name for column in NEEDED}
    for separator in () if needed & set(names) else _SEPARATORS:
        # A single name may be a word in a title.
        if len(needed & {name.strip(' "') for name in text.split(separator)}) > 1:
            return separator
    return None


def _check_names(file: TextFile, line: int, names: list[str], starts: list[int]) -> None:
    found = ", ".join(printable(name[:40]) or "''" for name in names[:20])
    found += ", ..." if len(names) > 20 else ""
    for column in COLUMNS:
        places = [start for start, name in zip(starts, names, strict=True) if name == column.name]
        if not places and column in NEEDED:
            what = f"{column.name}: the column is missing; found: {found}; allowed: {HEADER}"
            file.note(line, 1, what)
        for place in places[1:]:
            what = f"{column.name}: duplicate column, first at column {places[0]}"
            file.note(line, place, f"{what}; keep one of them")


def _hint(text: str) -> str:
    """Correction of a decimal comma."""
    found = _DECIMAL_COMMA.fullmatch(text.strip())
    return f" (write {found[1]}.{found[2]})" if found else ""
