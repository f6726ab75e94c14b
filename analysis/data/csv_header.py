"""Header of a CSV table of measurements: the place of each column that is read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from analysis.data.csv_columns import NEEDED, is_read
from analysis.data.csv_line import QuoteError, fields_of
from analysis.data.text_file import TextFile, input_error
from instrument.errors import InputError
from instrument.text.quoting import printable

HEADER = "a header with theta_i_deg, theta_r_deg, dphi_deg, brdf and, where known, u_brdf"
ROWS = "a row for each geometry"
MAX_COLUMNS = 1000
_SEPARATORS = {";": "';'", "\t": "tabs", " ": "spaces"}


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
    indices = {name: names.index(name) for name in names if is_read(name)}
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
    for column in NEEDED:
        if column.name not in names:
            what = f"{column.name}: the column is missing; found: {found}; allowed: {HEADER}"
            file.note(line, 1, what)
    for name in filter(is_read, dict.fromkeys(names)):
        places = [start for start, other in zip(starts, names, strict=True) if other == name]
        for place in places[1:]:
            what = f"{name}: duplicate column, first at column {places[0]}"
            file.note(line, place, f"{what}; keep one of them")
