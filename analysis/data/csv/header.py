"""Header of a CSV table of measurements: the place of each column that is read."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from analysis.data.csv.columns import COLUMNS, NEEDED, is_read, read_names
from instrument.errors import InputError
from instrument.text.csv_line import QuoteError, fields_of
from instrument.text.quoting import printable, shown
from instrument.text.text_file import TextFile, input_error

HEADER = "a header with theta_i_deg, theta_r_deg, dphi_deg, brdf and, where known, u_brdf"
ROWS = "a row for each geometry"
_JSON = f"is a JSON file; allowed: a table as text (CSV); write its values as a table, {ROWS}"
MAX_COLUMNS = 1000
_OTHER_UNIT = re.compile(r"\bm?rad\b|%")  # a new name alone would not convert the values
_SEARCHED_LINES = 100
_YAML_LINE = re.compile(r"[A-Za-z_]+:(\s|\Z)")
_GREEK = str.maketrans(
    {"θ": "theta_", "ϑ": "theta_", "φ": "phi_", "ϕ": "phi_", "δ": "d", "ᵢ": "i", "ᵣ": "r"}
)
_SEPARATORS = {";": "';'", "\t": "tabs", " ": "spaces"}


@dataclass(frozen=True, slots=True)
class Header:
    """Line number of the header, number of its columns, and index of each column by name.

    ignored: names of the columns that are not read.
    """

    line: int
    width: int
    indices: dict[str, int]
    ignored: tuple[str, ...] = ()


def read_header(file: TextFile, rows: Iterator[tuple[int, str]]) -> Header:
    """Read the header, the first of the file's rows; duplicate columns are noted.

    Raises `InputError` if there is no row, its fields cannot be separated, or a column is missing
    or written in another way.
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
        if _begins_like_json(text):
            raise _refused(file, line, 1, _JSON) from None
        raise _refused(file, line, error.column, f"header: {error}") from None
    names = [name.strip() for _, name in fields]
    separator = _other_separator(text, names)
    if separator is not None:
        what = f"header: fields are separated by {_SEPARATORS[separator]}: use commas"
        what += ", and a point in decimal numbers"
        raise _refused(file, line, text.index(separator) + 1, what)
    _check_names(file, line, names, [start for start, _ in fields])
    indices = {name: names.index(name) for name in names if is_read(name)}
    return Header(line, len(names), indices, tuple(n for n in names if n and n not in indices))


def _refused(file: TextFile, line: int, column: int, text: str) -> InputError:
    file.note(line, column, text)
    return input_error(file)


def _begins_like_json(text: str) -> bool:
    return text.lstrip().startswith(("{", "["))


def _other_separator(text: str, names: list[str]) -> str | None:
    """Separator of the names other than the comma; None if it is the comma, or not known."""
    needed = {column.name for column in NEEDED}
    for separator in () if needed & set(names) else _SEPARATORS:
        # A single name may be a word in a title.
        if len(needed & {name.strip(' "') for name in text.split(separator)}) > 1:
            return separator
    return None


def _check_names(file: TextFile, line: int, names: list[str], starts: list[int]) -> None:
    missing = [column.name for column in NEEDED if column.name not in names]
    if len(missing) == len(NEEDED) and _begins_like_json(names[0]):
        raise _refused(file, line, 1, _JSON)
    renamed = _renamed(names)
    if len(missing) == len(NEEDED) and not renamed:
        raise _refused(file, line, 1, _no_header(file, line, names))
    if missing or renamed:
        raise _refused(file, line, 1, _wrong_names(names, missing, renamed))
    for name in filter(is_read, dict.fromkeys(names)):
        places = [start for start, other in zip(starts, names, strict=True) if other == name]
        for place in places[1:]:
            what = f"{name}: duplicate column, first at column {places[0]}"
            file.note(line, place, f"{what}; keep one of them")


def _no_header(file: TextFile, line: int, names: list[str]) -> str:
    """A line without any known name: where the header may be, or what the file may be."""
    if _YAML_LINE.match(names[0]):
        return "header: the file looks like YAML, not like a table; `gonio plan` reads a protocol"
    needed = {column.name for column in NEEDED}
    for number, text in enumerate(file.lines[:_SEARCHED_LINES], start=1):
        if len(needed & {name.strip(' "#') for name in text.split(",")}) > 1:
            what = "remove its #" if number < line else "begin the lines above it with #"
            return f"header: line {number} looks like the header: {what}"
    return _wrong_names(names, [column.name for column in NEEDED], {})


def _wrong_names(names: list[str], missing: list[str], renamed: dict[str, str]) -> str:
    """Missing columns, and the names to change."""
    found = ", ".join(printable(name[:40]) or "''" for name in names[:20])
    found += ", ..." if len(names) > 20 else ""
    still = [name for name in missing if name not in renamed]
    parts = [f"missing: {', '.join(still)}" if still else ""]
    parts += [f"write {name} for {shown(given)}" for name, given in renamed.items()]
    parts += [f"found: {found}" if still else "", f"allowed: {HEADER}"]
    return f"header: {'; '.join(part for part in parts if part)}"


def _renamed(names: list[str]) -> dict[str, str]:
    """Given name by the name of a column that it means: in another case, or with a unit."""
    meant = {_plain(name): name for name in read_names()}
    meant |= {_plain(column.name.removesuffix("_deg")): column.name for column in COLUMNS}
    found: dict[str, str] = {}
    for given in names:
        name = meant.get(_plain(given), given)
        if name not in names and not _OTHER_UNIT.search(given):
            found.setdefault(name, given)
    return found


def _plain(name: str) -> str:
    """Name without case, unit in brackets, and separators; Greek letters by their names."""
    text = re.sub(r"[(\[{].*?[)\]}]|[/°].*", " ", name.lower().translate(_GREEK))
    words = re.sub(r"[\W_]+", " ", text).split()
    return "".join(words[:-1] if words[-1:] == ["degrees"] else words)
