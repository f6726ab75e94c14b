"""CSV reader for measurements: one row per geometry, columns identified by the header.

::

    theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf     any order; further columns are ignored
    30.0,-20.0,0.0,0.231,0.002                       u_brdf may be left out, but as a whole

Angles are those of `instrument/geometry.py`: theta_r_deg may be signed, and keeps its sign.
Blank lines and lines that begin with # are skipped. A quoted field may contain commas, but no line
end. Negative values of brdf are data: noise about zero.

The measurements.csv of a run is such a table. Its `flags` are ignored like any further column, so
flagged rows are read too; to leave them out, read the run's folder instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from analysis.data.csv_header import BRDF, COLUMNS, ROWS, U_BRDF, Column, Header, read_header
from analysis.data.csv_line import QuoteError, column_of, texts_of
from analysis.data.measurements import Measurements
from analysis.data.text_file import TextFile, input_error, read_text


def read_csv(path: Path) -> Measurements:
    """Read a table of N rows; `u_random` is None if u_brdf is absent, or empty in every row.

    A row with the same three angles as an earlier one is a mistake. The same direction given by
    other angles (theta_r = 0 at two dphi; -20, 0 and 20, 180) is another setting of the lamp, as
    in a scan with several dphi, and is read.
    Raises `InputError` with every mistake in the file; the first 20 are listed.
    """
    file = read_text(path, pipe=True)
    rows = file.rows()
    table = _Table(file, read_header(file, rows))
    for line, text in rows:
        table.add(line, text)
    table.finish()
    if file.mistakes:
        raise input_error(file)
    return table.measurements()


@dataclass(slots=True)
class _Table:
    """The rows below a header.

    rows: a value for each of COLUMNS, NaN where none could be read.
    first_lines: line of the first row with each geometry.
    blank: lines in which a column is empty that may be empty in every row.
    """

    file: TextFile
    header: Header
    rows: list[list[float]] = field(default_factory=list)
    first_lines: dict[tuple[float, ...], int] = field(default_factory=dict)
    blank: dict[str, list[int]] = field(default_factory=lambda: {"brdf": [], "u_brdf": []})

    def add(self, line: int, text: str) -> None:
        """Read a row, or note its mistakes."""
        try:
            fields = texts_of(text)
        except QuoteError as error:
            self.file.note(line, error.column, f"row: {error}")
            return
        if len(fields) != self.header.width:
            self._note_width(line, text, len(fields))
            return
        row = [self._value(line, column, fields) for column in COLUMNS]
        self.rows.append(row)
        angles = (row[0], row[1], row[2])
        first = self.first_lines.setdefault(angles, line)
        if first != line and not math.isnan(sum(angles)):
            what = f"the same three angles as in line {first}"
            self._note(line, "theta_i_deg", f"{what}; allowed: each geometry once")

    def _note_width(self, line: int, text: str, width: int) -> None:
        what = f"row: {width} {'field' if width == 1 else 'fields'}; allowed: {self.header.width}"
        what += f", as in the header (line {self.header.line})"
        if width < self.header.width:
            hint = " (separate fields by commas, not by ';')" if ";" in text else ""
            self.file.note(line, len(text) + 1, what + hint)
        else:
            hint = " (decimal numbers take a point; text with a comma needs quotes)"
            self.file.note(line, column_of(text, self.header.width), what + hint)

    def _value(self, line: int, column: Column, fields: list[str]) -> float:
        if column.name not in self.header.indices:
            return math.nan
        text = fields[self.header.indices[column.name]]
        if column.name in self.blank and not text.strip():
            self.blank[column.name].append(line)
            return math.nan
        try:
            return column.parse(text)
        except ValueError as error:
            self._note(line, column.name, str(error))
            return math.nan

    def _note(self, line: int, name: str, what: str) -> None:
        start = column_of(self.file.lines[line - 1], self.header.indices[name])
        self.file.note(line, start, f"{name}: {what}")

    def finish(self) -> None:
        """Note mistakes of the table as a whole."""
        if not self.rows:
            if not self.file.mistakes:
                what = f"header: no row follows; allowed: {ROWS}"
                self.file.note(self.header.line, 1, what)
        elif len(self.blank["brdf"]) == len(self.rows):
            what = "is empty in every row: no reference was taken, so there is no BRDF to fit"
            self._note(self.header.line, "brdf", f"{what}; allowed: a scan with a white tile")
        else:
            self._note_blank()

    def _note_blank(self) -> None:
        for column in (BRDF, U_BRDF):
            lines = self.blank[column.name]
            for line in lines if len(lines) < len(self.rows) else ():
                what = f"is empty here, but not in every row; allowed: {column.allowed}"
                self._note(line, column.name, what)

    def measurements(self) -> Measurements:
        """All rows in the order of the file, which must be free of mistakes."""
        theta_i, theta_r, dphi, brdf, u = np.array(self.rows).T
        return Measurements.bare(theta_i, theta_r, dphi, brdf, None if np.isnan(u).any() else u)
