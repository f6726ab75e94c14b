"""CSV reader for measurements: one row per geometry, columns identified by the header.

::

    theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf     any order; further columns are ignored
    30.0,-20.0,0.0,0.231,0.002                       u_brdf may be left out, but as a whole

Angles are those of `instrument/geometry.py`: theta_r_deg may be signed, and keeps its sign.
Blank lines and lines that begin with # are skipped. A quoted field may contain commas, but no line
end. Negative values of brdf are data: noise about zero.

A table may state more about its uncertainty in the columns that `columns` lists. The
measurements.csv of a run does: fitted, it gives what the run's folder gives.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from analysis.data.acceptance import Acceptance
from analysis.data.csv import columns
from analysis.data.csv.cells import Cells
from analysis.data.csv.columns import ANGLES, BRDF, U_BRDF
from analysis.data.csv.header import ROWS, Header, read_header
from analysis.data.measurements import Measurements, setting_numbers
from instrument.geometry import FloatArray
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
    table.add(rows)
    return table.content()


@dataclass(slots=True)
class _Table:
    """The rows below a header; `repeats` allows several of one geometry.

    lines, texts: of each row to fit. flagged: number of rows with a flag, which are not read any
    further.
    """

    file: TextFile
    header: Header
    repeats: bool
    lines: list[int] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    flagged: int = 0

    def add(self, rows: Iterable[tuple[int, str]]) -> None:
        """Take the rows, line and text of each, or note their mistakes."""
        flags, commas = self.header.indices.get(columns.FLAGS), self.header.width - 1
        for line, text in rows:
            plain = bool(self.texts) and '"' not in text and text.count(",") == commas
            if plain and flags is not None:
                plain = not text.split(",", flags + 1)[flags].strip()
            if plain or self._is_to_fit(line, text, flags):
                self.lines.append(line)
                self.texts.append(text)

    def _is_to_fit(self, line: int, text: str, flags: int | None) -> bool:
        """Look at one row closely; note its mistakes."""
        fields = self._fields(line, text)
        if fields is None:
            return False
        if flags is not None and fields[flags].strip():
            self.flagged += 1
            return False
        if not self.texts and self._holds_no_number(fields):
            what = "row: no number in it; begin a line of units or of names with #"
            self.file.note(line, 1, what)
            return False
        return True

    def _fields(self, line: int, text: str) -> list[str] | None:
        """Texts of a row; None, and a mistake noted, if they are not those of the header."""
        try:
            fields = texts_of(text)
        except QuoteError as error:
            self.file.note(line, error.column, f"row: {error}")
            return None
        if len(fields) != self.header.width:
            self._note_width(line, text, len(fields))
            return None
        return fields

    def _note_repeats(self, cells: Cells, *angles_deg: FloatArray) -> None:
        """Note each row with the same three angles, (N,) each, as an earlier one."""
        order = np.lexsort(angles_deg)
        if not np.any(np.all([np.diff(own[order]) == 0 for own in angles_deg], axis=0)):
            return
        first_lines: dict[tuple[float, ...], int] = {}
        places = zip(*(own.tolist() for own in angles_deg), strict=True)
        for n, (line, place) in enumerate(zip(self.lines, places, strict=True)):
            first = first_lines.setdefault(place, line)
            if first != line and not math.isnan(sum(place)):
                what = f"the same three angles as in line {first}"
                allowed = "each geometry once; average repeats with their u: --repeats mean"
                cells.note(n, "theta_i_deg", f"{what}; allowed: {allowed}")

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

    def content(self) -> CsvTable:
        """All rows in the order of the file. Raises `InputError` with every mistake."""
        if not self.texts and not self.file.mistakes and not self.flagged:
            what = f"header: no row follows; allowed: {ROWS}"
            self.file.note(self.header.line, 1, what)
            raise input_error(self.file)
        cells = Cells.of(self.file, self.header, self.lines, self.texts)
        theta_i, theta_r, dphi = (cells.needed(column) for column in ANGLES)
        if not self.repeats:
            self._note_repeats(cells, theta_i, theta_r, dphi)
        values, u_brdf = cells.numbers(BRDF), cells.numbers(U_BRDF)
        relative = values is None and bool(self.texts)
        brdf = self._relative(cells, theta_i) if values is None else values
        own = self._u_independent(cells, brdf)
        u_random = u_brdf if own is None else own
        setting = cells.whole_numbers(columns.LAMP_SETTING)
        shared, acceptance = cells.shared(), cells.acceptance()
        u_theta_i, u_theta_r, u_dphi = self._u_angles(cells, u_random)
        blur_deg = self._blur_deg(cells, theta_r)
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
            blur_deg=blur_deg,
            relative=relative,
            free_levels=relative,
        )
        states_shared, ignored = bool(shared) or own is not None, self.header.ignored
        return CsvTable(found, acceptance, self.flagged, states_shared, ignored)

    def _relative(self, cells: Cells, theta_i_deg: FloatArray) -> FloatArray:
        """Radiance over cos(theta_i), (N,), proportional to the BRDF at one lamp setting."""
        radiance = cells.numbers(columns.RADIANCE)
        if radiance is not None:
            return np.asarray(radiance / np.cos(np.radians(theta_i_deg)))
        what = "is empty in every row, and so is radiance; allowed: one of them"
        if columns.RADIANCE.name not in self.header.indices:
            what = "is empty in every row: no reference was taken, so there is no BRDF to fit"
            what += "; allowed: a scan with a white tile, or a column radiance"
        if self.texts:
            cells.note_header("brdf", what)
        return np.zeros_like(theta_i_deg)

    def _u_independent(self, cells: Cells, values: FloatArray) -> FloatArray | None:
        """Independent u (N,) in the unit of the values, where it is stated relative to them."""
        column = columns.U_INDEPENDENT
        u_relative = cells.numbers(column)
        if u_relative is None:
            return None
        u = u_relative * np.abs(values)
        for n in np.flatnonzero(u < U_BRDF.low):
            what = f"of {values[n]:g} is {u[n]:g}; allowed: {U_BRDF.low:g} or more; state u_brdf"
            cells.note(int(n), column.name, what)
        return u

    def _blur_deg(self, cells: Cells, theta_r_deg: FloatArray) -> FloatArray | float:
        """Angle (N,) by which theta_r turned for each row, in degrees, 0 if not stated."""
        column = columns.BLUR
        blur_deg = cells.numbers(column)
        if blur_deg is None:
            return 0.0
        for n in np.flatnonzero(np.abs(theta_r_deg) + blur_deg / 2 > 90):
            allowed = f"{180 - 2 * abs(theta_r_deg[n]):g} deg or less about {theta_r_deg[n]:g} deg"
            cells.note(int(n), column.name, f"{blur_deg[n]:g} deg; allowed: {allowed}")
        return blur_deg

    def _u_angles(self, cells: Cells, u_random: FloatArray | None) -> list[float]:
        """Standard uncertainties of theta_i, theta_r and dphi in degrees, 0 if not stated."""
        found = []
        for column in columns.U_ANGLES:
            found.append(cells.constant(column) or 0.0)
            if found[-1] > 0 and u_random is None:
                what = f"is stated; allowed: with u_brdf or {columns.U_INDEPENDENT.name} only"
                cells.note_header(column.name, what)
        return found
