"""Optional columns of a CSV table: lamp settings, shared errors, and acceptance of the rig."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.data import csv_columns as columns
from analysis.data.acceptance import Acceptance
from analysis.data.csv_header import Header
from analysis.data.measurements import SharedError
from instrument.geometry import FloatArray, IntArray
from instrument.text.csv_column import Column
from instrument.text.csv_line import column_of
from instrument.text.text_file import TextFile


@dataclass(frozen=True, slots=True)
class OptionalColumns:
    """Reader of optional columns in the rows to fit, (N,): line and fields of each.

    A column that is absent, or empty in every row, is None. Mistakes are noted in the file.
    """

    file: TextFile
    header: Header
    rows: list[tuple[int, list[str]]]

    def numbers(self, column: Column) -> FloatArray | None:
        """Numbers (N,) of a column, in its unit."""
        index = self.header.indices.get(column.name)
        if index is None:
            return None
        texts = [fields[index].strip() for _, fields in self.rows]
        if not any(texts):
            return None
        known: dict[str, float] = {}
        values = np.empty(len(texts))
        for n, text in enumerate(texts):
            try:
                if text not in known:
                    known[text] = column.parse(text)
                values[n] = known[text]
            except ValueError as error:
                values[n] = np.nan
                self.note(n, column.name, str(error))
        return values

    def whole_numbers(self, column: Column) -> IntArray | None:
        """Whole numbers (N,) of a column, less 1: files count from 1."""
        values = self.numbers(column)
        return None if values is None else np.nan_to_num(values).astype(np.int64) - 1

    def constant(self, column: Column) -> float | None:
        """Number that a column has in every row, in its unit."""
        values = self.numbers(column)
        if values is None:
            return None
        differ = np.flatnonzero(values != values[0])
        for n in () if np.isnan(values).any() else differ[:1]:
            what = f"{values[n]:g} {column.unit}; allowed: {values[0]:g} {column.unit}, as in"
            self.note(int(n), column.name, f"{what} line {self.rows[0][0]}: one for all rows")
        return float(values[0])

    def shared(self) -> tuple[SharedError, ...]:
        """All errors that rows share."""
        found = []
        for stem in columns.shared_stems(self.header.indices):
            u_relative = self.numbers(columns.u_shared(stem))
            if u_relative is not None:
                group = self.whole_numbers(columns.group(stem))
                group = np.zeros(len(self.rows), dtype=np.int64) if group is None else group
                angles = (self.numbers(column) for column in columns.angles_by(stem))
                by_angle = (0.0 if angle is None else angle for angle in angles)
                found.append(SharedError(columns.error_name(stem), u_relative, group, *by_angle))
        return tuple(found)

    def acceptance(self) -> Acceptance | None:
        """Acceptance of the rig; its columns are all needed, or none."""
        values = {column.name: self.constant(column) for column in columns.ACCEPTANCE}
        missing = [name for name, value in values.items() if value is None]
        if len(missing) == len(values):
            return None
        for name in missing:
            what = f"{name}: missing or empty; allowed: all of {', '.join(values)}, or none"
            self.file.note(self.header.line, 1, what)
        known = {name: value for name, value in values.items() if value is not None}
        return None if missing or self.file.mistakes else Acceptance(**known)

    def note(self, row: int, name: str, what: str) -> None:
        """Note a mistake in one of the rows."""
        line = self.rows[row][0]
        start = column_of(self.file.lines[line - 1], self.header.indices[name])
        self.file.note(line, start, f"{name}: {what}")
