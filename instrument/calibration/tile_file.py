"""CSV file of a white tile's radiance factors: one row for each geometry of a complete grid.

::

    theta_i_deg,theta_r_deg,dphi_deg,beta,u_beta,u_beta_common
    0,10,0,1.052,0.003,0.004       u (k = 1) of the value by itself, and of what all values share
    15,10,0,1.043,0.003,0.004      u_beta_common may be left out, as a whole

The rows are sorted by the three angles, in the order in which the header names them. Blank lines
and lines that begin with # are skipped. Every mistake is reported with its line and column.
"""

from __future__ import annotations

import difflib
import itertools
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from instrument.calibration.tile_table import ANGLES, TileTable
from instrument.text.csv_column import Column
from instrument.text.csv_line import QuoteError, fields_of
from instrument.text.quoting import shown
from instrument.text.text_file import TextFile, input_error, read_text

_MOST_BETA = 5.0  # what is called white sends no five times as much light into any direction
_U = (f"0 to {_MOST_BETA:g}, k = 1, in the unit of beta", 0.0, _MOST_BETA)
_COLUMNS = {
    column.name: column
    for column in (
        Column("theta_i_deg", "deg", "0 to 90 deg", 0.0, 90.0),
        Column("theta_r_deg", "deg", "-90 to 90 deg", -90.0, 90.0),
        Column("dphi_deg", "deg", "-360 to 360 deg", -360.0, 360.0),
        Column("beta", "", f"0.001 to {_MOST_BETA:g}, not in %", 1e-3, _MOST_BETA),
        Column("u_beta", "", *_U),
        Column("u_beta_common", "", *_U),
    )
}
_NEEDED = tuple(name for name in _COLUMNS if name != "u_beta_common")
_HEADER = f"{', '.join(_NEEDED)} and perhaps u_beta_common"
MAX_ROWS = 100_000


def read_tile_table(path: Path) -> TileTable:
    """Read the table of a white tile. Raises `InputError` with every mistake in the file."""
    file = read_text(path)
    reader = _Reader(file)
    for line, text in file.rows():
        reader.add(line, text)
    reader.require_grid()
    if file.mistakes:
        raise input_error(file)
    return reader.table()


@dataclass(slots=True)
class _Reader:
    """Rows of a table so far: names of the columns, and by row its line and its values."""

    file: TextFile
    names: list[str] = field(default_factory=list)
    rows: list[tuple[int, dict[str, float]]] = field(default_factory=list)

    def add(self, line: int, text: str) -> None:
        """Read the header or a row, or note its mistakes."""
        try:
            fields = list(fields_of(text))
        except QuoteError as error:
            self.file.note(line, error.column, f"row: {error}")
            return
        if not self.names:
            self._read_header(line, fields)
        elif len(fields) != len(self.names):
            what = f"row: {len(fields)} fields; allowed: {len(self.names)}, as in the header"
            self.file.note(line, 1, what)
        else:
            self._read_row(line, fields)

    def _read_header(self, line: int, fields: list[tuple[int, str]]) -> None:
        self.names = [text.strip() for _, text in fields]
        misspelt: list[str] = []
        for (start, _), name in zip(fields, self.names, strict=True):
            if name not in _COLUMNS:
                near = difflib.get_close_matches(name, _COLUMNS, n=1)
                misspelt += near
                meant = f"did you mean {near[0]}? " if near else ""
                what = f"header: unknown column {shown(name)}; {meant}allowed: {_HEADER}"
                self.file.note(line, start, what)
            elif self.names.count(name) > 1:
                self.file.note(line, start, f"header: {name} stands twice; allowed: each once")
        missing = [name for name in _NEEDED if name not in (*self.names, *misspelt)]
        if missing:
            what = f"header: {', '.join(missing)} is missing; allowed: {_HEADER}"
            self.file.note(line, 1, what)
        if self.file.mistakes:
            raise input_error(self.file)

    def _read_row(self, line: int, fields: list[tuple[int, str]]) -> None:
        row, places = {"u_beta_common": 0.0}, {}
        for (start, text), name in zip(fields, self.names, strict=True):
            places[name] = start
            try:
                row[name] = _COLUMNS[name].parse(text)
            except ValueError as error:
                self.file.note(line, start, f"{name}: {error}")
        if len(row) < len(_COLUMNS):
            return
        for name in ("u_beta", "u_beta_common"):
            if row[name] >= row["beta"] / 2:
                allowed = f"less than half of beta {row['beta']:g} (k = 1, absolute and not in %)"
                self.file.note(line, places[name], f"{name}: {row[name]:g}; allowed: {allowed}")
        self._require_sorted(line, row, places)
        self.rows.append((line, row))
        if len(self.rows) > MAX_ROWS:
            self.file.note(line, 1, f"row: too many; allowed: {MAX_ROWS} rows")
            raise input_error(self.file)

    @property
    def _order(self) -> list[str]:
        """The angles in the order of the header: the first changes slowest."""
        return [name for name in self.names if name in ANGLES]

    def _require_sorted(self, line: int, row: dict[str, float], places: dict[str, int]) -> None:
        if not self.rows:
            return
        earlier, before = self.rows[-1]
        changed = next((name for name in self._order if row[name] != before[name]), None)
        order = f"rows sorted by {', then '.join(self._order)}, each geometry once"
        if changed is None:
            what = f"{self._order[0]}: the same three angles as in line {earlier}"
            self.file.note(line, places[self._order[0]], f"{what}; allowed: {order}")
        elif row[changed] < before[changed]:
            what = f"{changed}: {row[changed]:g} deg after {before[changed]:g} deg in line"
            self.file.note(line, places[changed], f"{what} {earlier}; allowed: {order}")

    def require_grid(self) -> None:
        """Note a table without rows, of one row, or with a gap."""
        if not self.names:
            self.file.note(1, 1, f"the file is empty; allowed: a header with {_HEADER}, and rows")
        elif self.file.mistakes:
            return
        elif len(self.rows) < 2:
            number = "no row" if not self.rows else "one row"
            what = f"row: {number} after the header; allowed: 2 or more; for one number take the"
            self.file.note(len(self.file.lines), 1, f"{what} keys reflectance and u_reflectance")
        else:
            self._require_no_gap()

    def _require_no_gap(self) -> None:
        axes = self._axes()
        size = int(np.prod([axis.size for axis in axes]))
        if size == len(self.rows):
            return
        grid = itertools.product(*(axis.tolist() for axis in axes))
        found = [*([row[name] for name in self._order] for _, row in self.rows), []]
        number, expected = next(
            (k, angles) for k, angles in enumerate(grid) if list(angles) != found[k]
        )
        lines = [*(line for line, _ in self.rows), len(self.file.lines)]
        names = zip(self._order, expected, strict=True)
        absent = ", ".join(f"{name.removesuffix('_deg')} {angle:g}" for name, angle in names)
        what = f"row: there is none for {absent} deg before it; allowed: a complete grid, here of"
        sizes = " x ".join(str(axis.size) for axis in axes)
        self.file.note(lines[number], 1, f"{what} {sizes} = {size} rows, and not {len(self.rows)}")

    def _axes(self) -> list[np.ndarray]:
        return [np.unique([row[name] for _, row in self.rows]) for name in self._order]

    def table(self) -> TileTable:
        """Return the table of a file without mistakes."""
        shape, order = [axis.size for axis in self._axes()], self._order
        turned = [order.index(name) for name in ANGLES]
        beta, u_beta, u_common = (
            np.array([row[name] for _, row in self.rows]).reshape(shape).transpose(turned)
            for name in ("beta", "u_beta", "u_beta_common")
        )
        axes = [self._axes()[k] for k in turned]
        text = "\n".join(self.file.lines)
        return TileTable((axes[0], axes[1], axes[2]), beta, u_beta, u_common, text)
