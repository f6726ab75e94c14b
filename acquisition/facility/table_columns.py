"""Table of a run, `measurements.csv`, as columns of values, and back to the same text."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence

from instrument.config.protocol import Metadata

Column = list[float] | list[int] | list[str]
Columns = dict[str, Column]
_TEXTS = {"flags", "time_utc", "chosen_for", *Metadata.model_fields}
_FORMATS = {"window_pixels": ".2f"}


def columns_of(table: str) -> Columns:
    """Return the columns of a table by name: whole numbers, numbers (NaN for none), or texts."""
    header, *rows = csv.reader(io.StringIO(table))
    return {name: _column(name, [row[n] for row in rows]) for n, name in enumerate(header)}


def table_of(columns: Mapping[str, Sequence[float | int | str]]) -> str:
    """Return the text of the table with these columns."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    cells = [[_cell(name, value) for value in values] for name, values in columns.items()]
    writer.writerows(zip(*cells, strict=True))
    return text.getvalue()


def _column(name: str, cells: list[str]) -> Column:
    if name in _TEXTS:
        return cells
    if cells and all(cell.isdigit() for cell in cells):
        return [int(cell) for cell in cells]
    return [float(cell) if cell else math.nan for cell in cells]


def _cell(name: str, value: float | int | str) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, float) and math.isnan(value):
        return ""
    return format(value, _FORMATS[name]) if name in _FORMATS else repr(value)
