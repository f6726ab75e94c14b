"""CSV reader for measurements: one row per geometry, columns identified by the header.

::

    theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf     any order; further columns are ignored
    30.0,-20.0,0.0,0.231,0.002                       u_brdf may be left out, but as a whole

Angles are those of `instrument/geometry.py`: theta_r_deg may be signed, and keeps its sign.
Blank lines and lines that begin with # are skipped. A quoted field may contain commas, but no line
end. Negative values of brdf are data: noise about zero.

A table may state more about its uncertainty in the columns of `csv_columns`. The measurements.csv
of a run does: fitted, it gives what the run's folder gives.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from analysis.data import csv_columns as columns
from analysis.data.acceptance import Acceptance
from analysis.data.csv_columns import ANGLES, BRDF, COLUMNS, U_BRDF
from analysis.data.csv_header import ROWS, Header, read_header
from analysis.data.csv_optional import OptionalColumns
from analysis.data.measurements import Measurements, setting_numbers
from instrument.geometry import FloatArray
from instrument.text.csv_column import Column
from instrument.text.csv_line import QuoteError, column_of, texts_of
from instrument.text.text_file import TextFile, input_error, read_text


@dataclass(frozen=True, slots=True)
class CsvTable:
    """Content of a table: the rows to fit, and the rig's acceptance where it is stated.

    flagged: number of rows left out because of their flags. states_shared: the table has columns
    about errors that rows share, or states the independent part of u. ignored: names of the columns
    that are not read.
    """

    measurements: Measurements
    acceptance: Acceptance | None
    flagged: int
    states_shared: bool
    ignored: tuple[str, ...]


def read_csv(path: Path) -> Measurements:
    """Read the rows to fit of a table, as `read_table` does."""
    return read_table(path).measurements


def read_table(path: Path, *, repeats: bool = False) -> CsvTable:
    """Read a file as `table_of` does."""
    return table_of(read_text(path, pipe=True), repeats=repeats)


def table_of(file: TextFile, *, repeats: bool = False) -> CsvTable:
    """Read a table; `u_random` is None if no u is stated, or u_brdf is empty in every row.

    A row with the same three angles as an earlier one is a mistake, unless `repeats` allows it.
    The same direction given by other angles (theta_r = 0 at two dphi; -20, 0 and 20, 180) is
    another setting of the lamp, as in a scan with several dphi, and is read. Where brdf is empty in
    every row, radiance over cos(theta_i) is read, relative to a level of each lamp setting.
    Raises `InputError` with every mistake in the file; three of a kind are listed.
    """
    rows = file.rows()
    table = _Table(file, read_header(file, rows), repeats)
    for line, text in rows:
        table.add(line, text)
    table.finish()
    if file.mistakes:
        raise input_error(file)
    return table.content()


@dataclass(slots=True)
class _Table:
    """The rows below a header; `repeats` allows several of one geometry.

    rows: a value for each of COLUMNS, NaN where none could be read. fields: line and texts of each
        of these rows.
    flagged: number of rows with a flag, which are not read any further.
    first_lines: line of the first row with each geometry.
    blank: lines in which a column is empty that may be empty in every row.
    """

    file: TextFile
    header: Header
    repeats: bool
    rows: list[list[float]] = field(default_factory=list)
    fields: list[tuple[int, list[str]]] = field(default_factory=list)
    flagged: int = 0
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
        flags = self.header.indices.get(columns.FLAGS)
        if flags is not None and fields[flags].strip():
            self.flagged += 1
            return
        if not self.fields and self._holds_no_number(fields):
            what = "row: no number in it; begin a line of units or of names with #"
            self.file.note(line, 1, what)
            return
        row = [self._value(line, column, fields) for column in COLUMNS]
        self.rows.append(row)
        self.fields.append((line, fields))
        angles = (row[0], row[1], row[2])
        first = self.first_lines.setdefault(angles, line)
        if first != line and not self.repeats and not math.isnan(sum(angles)):
            what = f"the same three angles as in line {first}"
            allowed = "each geometry once; average repeats with their u: --repeats mean"
            self._note(line, "theta_i_deg", f"{what}; allowed: {allowed}")

    def _holds_no_number(self, fields: list[str]) -> bool:
        """True if each angle is a text without a digit, as in a second line of the header."""
        texts = [fields[self.header.indices[column.name]].strip() for column in ANGLES]
        return all(text and not any(map(str.isdigit, text)) for text in texts)

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
            if not self.file.mistakes and not self.flagged:
                what = f"header: no row follows; allowed: {ROWS}"
                self.file.note(self.header.line, 1, what)
        elif self._no_brdf and columns.RADIANCE.name not in self.header.indices:
            what = "is empty in every row: no reference was taken, so there is no BRDF to fit"
            allowed = "a scan with a white tile, or a column radiance"
            self._note(self.header.line, "brdf", f"{what}; allowed: {allowed}")
        else:
            self._note_blank()

    @property
    def _no_brdf(self) -> bool:
        return 0 < len(self.rows) == len(self.blank["brdf"])

    def _note_blank(self) -> None:
        for column in (BRDF, U_BRDF):
            lines = self.blank[column.name]
            for line in lines if len(lines) < len(self.rows) else ():
                what = f"is empty here, but not in every row; allowed: {column.allowed}"
                self._note(line, column.name, what)

    def content(self) -> CsvTable:
        """All rows in the order of the file; further mistakes are noted, and raised.

        Raises `InputError`.
        """
        theta_i, theta_r, dphi, brdf, u = np.array(self.rows).reshape(-1, len(COLUMNS)).T
        optional = OptionalColumns(self.file, self.header, self.fields)
        brdf = self._relative(optional, theta_i) if self._no_brdf else brdf
        own = self._u_independent(optional, brdf)
        u_random = None if own is None and np.isnan(u).any() else u if own is None else own
        setting = optional.whole_numbers(columns.LAMP_SETTING)
        shared, acceptance = optional.shared(), optional.acceptance()
        u_theta_i, u_theta_r, u_dphi = self._u_angles(optional, u_random)
        if self.file.mistakes:
            raise input_error(self.file)
        found = Measurements(
            theta_i_deg=theta_i,
            theta_r_deg=theta_r,
            dphi_deg=dphi,
            brdf=brdf,
            u_random=u_random,
            lamp_setting=setting_numbers(theta_i, dphi) if setting is None else setting,
            shared=shared,
            u_theta_i_deg=u_theta_i,
            u_theta_r_deg=u_theta_r,
            u_dphi_deg=u_dphi,
            relative=self._no_brdf,
            free_levels=self._no_brdf,
        )
        states_shared, ignored = bool(shared) or own is not None, self.header.ignored
        return CsvTable(found, acceptance, self.flagged, states_shared, ignored)

    def _relative(self, optional: OptionalColumns, theta_i_deg: FloatArray) -> FloatArray:
        """Radiance over cos(theta_i), (N,), proportional to the BRDF at one lamp setting."""
        radiance = optional.numbers(columns.RADIANCE)
        if radiance is None:
            what = "is empty in every row, and so is radiance; allowed: one of them"
            self._note(self.header.line, "brdf", what)
            return np.zeros_like(theta_i_deg)
        return np.asarray(radiance / np.cos(np.radians(theta_i_deg)))

    def _u_independent(self, optional: OptionalColumns, values: FloatArray) -> FloatArray | None:
        """Independent u (N,) in the unit of the values, where it is stated relative to them."""
        column = columns.U_INDEPENDENT
        u_relative = optional.numbers(column)
        if u_relative is None:
            return None
        u = u_relative * np.abs(values)
        for n in np.flatnonzero(u < U_BRDF.low):
            what = f"of {values[n]:g} is {u[n]:g}; allowed: {U_BRDF.low:g} or more; state u_brdf"
            optional.note(int(n), column.name, what)
        return u

    def _u_angles(self, optional: OptionalColumns, u_random: FloatArray | None) -> list[float]:
        """Standard uncertainties of theta_i, theta_r and dphi in degrees, 0 if not stated."""
        found = []
        for column in columns.U_ANGLES:
            found.append(optional.constant(column) or 0.0)
            if found[-1] > 0 and u_random is None:
                what = f"is stated; allowed: with u_brdf or {columns.U_INDEPENDENT.name} only"
                self._note(self.header.line, column.name, what)
        return found
