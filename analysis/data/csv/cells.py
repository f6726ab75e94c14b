"""Cells of a CSV table as numbers, a column at a time: lamp settings, shared errors, the rig."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.acceptance import Acceptance
from analysis.data.csv import columns
from analysis.data.csv.header import Header
from analysis.data.measurements import SharedError
from instrument.geometry import FloatArray, IntArray
from instrument.text.csv_column import Column
from instrument.text.csv_line import column_of, texts_of
from instrument.text.text_file import TextFile


@dataclass(frozen=True, slots=True)
class Cells:
    """Rows to fit, (N,): line and text of each. Mistakes are noted in the file.

    at_once: (N,) by the name of their column, the numbers that NumPy read; see `of`.
    """

    file: TextFile
    header: Header
    lines: list[int]
    texts: list[str]
    at_once: dict[str, FloatArray]

    @classmethod
    def of(cls, file: TextFile, header: Header, lines: list[int], texts: list[str]) -> Cells:
        """Return the rows, with the columns that hold a number in the first row read at once."""
        return cls(file, header, lines, texts, _at_once(header, texts))

    def needed(self, column: Column) -> FloatArray:
        """Numbers (N,) of a column, in its unit; NaN where there is none, which is a mistake."""
        known = self._read(column)
        return self._parsed(column, self._texts(column)) if known is None else known

    def numbers(self, column: Column) -> FloatArray | None:
        """Numbers (N,) of a column, in its unit; None if it is absent, or empty in every row.

        NaN where there is none, or none that is allowed, which is a mistake.
        """
        known = self._read(column)
        if known is not None or column.name not in self.header.indices:
            return known
        texts = self._texts(column)
        return self._parsed(column, texts) if any(text.strip() for text in texts) else None

    def _read(self, column: Column) -> FloatArray | None:
        """Numbers (N,) of a column that was read at once, if all of them are allowed."""
        values = self.at_once.get(column.name)
        return values if values is not None and column.allows(values) else None

    def _texts(self, column: Column) -> list[str]:
        index = self.header.indices[column.name]
        return [texts_of(text)[index] for text in self.texts]

    def _parsed(self, column: Column, texts: Sequence[str]) -> FloatArray:
        known: dict[str, float] = {}
        values = np.full(len(texts), np.nan)
        for n, text in enumerate(texts):
            if not text.strip() and column not in columns.ANGLES:
                what = f"is empty here, but not in every row; allowed: {column.allowed}"
                self.note(n, column.name, what)
                continue
            try:
                if text not in known:
                    known[text] = column.parse(text)
                values[n] = known[text]
            except ValueError as error:
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
            self.note(int(n), column.name, f"{what} line {self.lines[0]}: one for all rows")
        return float(values[0])

    def shared(self) -> tuple[SharedError, ...]:
        """All errors that rows share."""
        found = []
        for stem in columns.shared_stems(self.header.indices):
            u_relative = self.numbers(columns.u_shared(stem))
            if u_relative is not None:
                group = self.whole_numbers(columns.group(stem))
                group = np.zeros(len(self.texts), dtype=np.int64) if group is None else group
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
        self._note(self.lines[row], name, what)

    def note_header(self, name: str, what: str) -> None:
        """Note a mistake of a whole column."""
        self._note(self.header.line, name, what)

    def _note(self, line: int, name: str, what: str) -> None:
        start = column_of(self.file.lines[line - 1], self.header.indices[name])
        self.file.note(line, start, f"{name}: {what}")


def _at_once(header: Header, texts: list[str]) -> dict[str, FloatArray]:
    """Return the numbers (N,) of all columns that hold one in the first row; none for a mistake.

    NumPy's reader takes the same numbers as Python, but without underscores, as `Column` does.
    """
    if not texts or any('"' in text for text in texts):
        return {}
    first = texts[0].split(",")
    found = {name: k for name, k in header.indices.items() if _is_number(first[k])}
    try:
        values = np.loadtxt(texts, delimiter=",", comments=None, usecols=[*found.values()], ndmin=2)
    except ValueError:  # the cell that is no number is looked for, and named, by its column
        return {}
    return dict(zip(found, values.T, strict=True))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
