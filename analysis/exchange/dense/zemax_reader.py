"""Reader of Zemax tabular BSDF files, in the layout that `zemax.py` describes.

Directions below the horizon are left out, and of a file that says in its comments which values are
measured, all others. A direction that stands in several rows, as the specular one does in each,
is read once.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np

from analysis.data.csv.columns import ANGLES, BRDF
from analysis.exchange.dense.specular_grid import MEASURED, directions
from analysis.exchange.dense.zemax import MARKS_KEY
from analysis.exchange.exported import BrdfTable
from analysis.exchange.tables.rows import Row, parsed, table, words
from instrument.geometry import FloatArray, Geometry
from instrument.text.csv_column import Column
from instrument.text.quoting import shown
from instrument.text.text_file import TextFile, input_error

_ALLOWED = {
    "Source": ("Measured",),
    "Symmetry": ("PlaneSymmetrical", "ASymmetrical"),
    "SpectralContent": ("Monochrome",),
    "ScatterType": ("BRDF",),
}
_COUNT = Column("number", "", "1 to 10000, a whole number", 1, 10_000, whole=True)
_AXES = {
    "SampleRotation": Column("SampleRotation", "deg", "-1e6 to 1e6 deg", -1e6, 1e6),
    "AngleOfIncidence": ANGLES[0],
    "ScatterAzimuth": Column("ScatterAzimuth", "deg", "0 to 360 deg", 0.0, 360.0),
    "ScatterRadial": Column("ScatterRadial", "deg", "0 to 180 deg", 0.0, 180.0),
}
_MOST = 2_000_000  # values
_TIS = Column("TIS", "", "-1e6 to 1e6", -1e6, 1e6)
_ROW = "a block TIS with a row for each azimuth, for each incidence"


@dataclass(slots=True)
class _Text:
    """Words of a file with their places, read one by one."""

    file: TextFile
    words: Iterator[tuple[int, int, str]]
    line: int = 1

    def next(self, what: str) -> tuple[int, int, str]:
        """Return line, column and text of the next word; `what`: for the error at the end."""
        word = next(self.words, None)
        if word is None:
            self.stop(len(self.file.lines), 1, f"ends before {what}; allowed: a complete file")
        self.line = word[0]
        return word

    def number(self, column: Column) -> float:
        """Return the next word as a number in a column."""
        line, place, text = self.next(column.name)
        return parsed(self.file, line, column, (place, text))

    def stop(self, line: int, column: int, what: str) -> NoReturn:
        """Note a mistake after which the rest cannot be understood, and raise `InputError`."""
        self.file.note(line, column, what)
        raise input_error(self.file)


@dataclass(slots=True)
class _Head:
    """Facts of a header: its keys with a text, and its axes in degrees."""

    texts: dict[str, str] = field(default_factory=dict)
    axes: dict[str, list[float]] = field(default_factory=dict)


def is_zemax(file: TextFile) -> bool:
    """True for a text with a line ScatterRadial."""
    return any(text.split()[:1] == ["ScatterRadial"] for text in file.lines)


def read_zemax(file: TextFile) -> BrdfTable:
    """Read the measured values; raises `InputError` for what is not allowed."""
    text = _Text(file, ((n, *word) for n, line in file.rows() for word in words(line)))
    head = _read_head(text)
    _check(text, head)
    theta_i, azimuth, radial = (
        np.array(head.axes[name])
        for name in ("AngleOfIncidence", "ScatterAzimuth", "ScatterRadial")
    )
    marks = _marks(file)
    rows: list[Row] = []
    for angle in theta_i.tolist():
        block = _block(text, azimuth.size, radial.size)
        if file.mistakes:
            raise input_error(file)
        rows += _rows(angle, azimuth, radial, block, marks)
    _expect(text, "DataEnd")
    return table(file, rows, _ROW)


def _read_head(text: _Text) -> _Head:
    head = _Head()
    while True:
        line, column, key = text.next("DataBegin")
        if key in _ALLOWED:
            head.texts[key] = text.next(key)[2]
        elif key in _AXES:
            count = text.number(_COUNT)
            if text.file.mistakes:
                raise input_error(text.file)
            head.axes[key] = [text.number(_AXES[key]) for _ in range(int(count))]
        elif key == "Monochrome":
            _expect(text, "DataBegin")
            return head
        else:
            allowed = ", ".join([*_ALLOWED, *_AXES, "Monochrome"])
            text.stop(line, column, f"keyword: {shown(key)}; allowed: {allowed}")


def _expect(text: _Text, keyword: str) -> None:
    line, column, found = text.next(keyword)
    if found != keyword:
        text.stop(line, column, f"{shown(found)}; allowed: {keyword}")


def _check(text: _Text, head: _Head) -> None:
    """Raise `InputError` for a header that is not understood, or that is not of one sample."""
    file, line = text.file, text.line
    for key, allowed in _ALLOWED.items():
        found = head.texts.get(key)
        if found is None or found.lower() not in [name.lower() for name in allowed]:
            file.note(line, 1, f"{key}: {shown(found)}; allowed: {' or '.join(allowed)}")
    for name in _AXES:
        if name not in head.axes:
            file.note(line, 1, f"no {name}; allowed: {name}, a number, and so many angles")
    if len(head.axes.get("SampleRotation", [0])) != 1:
        rotations = len(head.axes["SampleRotation"])
        file.note(
            line, 1, f"SampleRotation: {rotations} rotations; allowed: 1; keep one in the file"
        )
    size = math.prod(len(axis) for axis in head.axes.values())
    if size > _MOST:
        file.note(line, 1, f"{size} values; allowed: {_MOST}; split the file by incidence")
    if file.mistakes:
        raise input_error(file)


def _block(text: _Text, azimuths: int, radials: int) -> FloatArray:
    """Values (azimuths, radials) of one incidence in 1/sr."""
    _expect(text, "TIS")
    text.number(_TIS)
    values = [text.number(BRDF) for _ in range(azimuths * radials)]
    return np.array(values).reshape(azimuths, radials)


def _marks(file: TextFile) -> dict[tuple[float, float], str]:
    """Marks of the values by incidence and azimuth in degrees, where the comments have them."""
    form = re.compile(rf"# {MARKS_KEY} (\S+) (\S+) (\S+)")
    found = (form.fullmatch(line) for line in file.lines if line.startswith("# "))
    return {(float(m[1]), float(m[2])): m[3] for m in found if m and _are_numbers(m[1], m[2])}


def _are_numbers(*texts: str) -> bool:
    return all(re.fullmatch(r"[0-9.]+(e[-+]?[0-9]+)?", t) and t.count(".") < 2 for t in texts)


def _rows(
    theta_i: float,
    azimuth: FloatArray,
    radial: FloatArray,
    block: FloatArray,
    marks: dict[tuple[float, float], str],
) -> list[Row]:
    """Rows of one incidence: directions above the horizon, each once, and measured."""
    azimuths, radials = np.meshgrid(azimuth, radial, indexing="ij")
    keep = np.ones(block.shape, dtype=bool)
    if marks:
        letters = [marks.get((theta_i, a), "").ljust(radial.size)[: radial.size] for a in azimuth]
        keep = np.array([list(row) for row in letters]) == MEASURED
    vectors = directions(theta_i, azimuths, radials)
    keep &= vectors[..., 2] > -1e-9
    _, first = np.unique(np.round(vectors.reshape(-1, 3), 9), axis=0, return_index=True)
    once = np.zeros(keep.size, dtype=bool)
    once[first] = True
    keep &= once.reshape(keep.shape)
    to_lamp = np.array([np.sin(np.radians(theta_i)), 0.0, np.cos(np.radians(theta_i))])
    view = Geometry.from_directions(to_lamp, vectors[keep])
    columns = (np.minimum(view.theta_r_deg, 90.0), view.dphi_deg, block[keep])
    return [
        (theta_i, r, dphi, value, math.nan) for r, dphi, value in np.transpose(columns).tolist()
    ]
