"""Light of the cells in each reading of a run, from the frames that it has kept."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.hot_pixels import find_hot_pixels
from acquisition.measure.rectify.cell_grid import CellGrid
from acquisition.measure.rectify.kept_files import cells_name, dark_name, step_of
from acquisition.measure.rectify.light import FloatImage, light_dn
from acquisition.measure.rectify.of_sample import cells_of
from acquisition.results.maps.surface_height import at_height, smoothing
from instrument.config.load import Loaded
from instrument.errors import InputError
from instrument.geometry import BoolArray, FloatArray
from instrument.pinhole import Pinhole
from instrument.record.reading import Reading
from instrument.record.record import Record
from instrument.text.atomic_file import read_file

_WORKERS = 2
_SEARCHED = 192  # cells along a side, at most, in which the height is looked for
_U_HEIGHT = 0.2  # of gathered cells: an edge within one seems to move more, or less (own trial)
_SHOWN = 3  # names of missing files in a message


@dataclass(frozen=True, slots=True)
class CellLight:
    """Light of each cell in K readings, in DN: cells (K, rows, columns), NaN where there is none.

    window: (K,), that of the measuring window in the same pictures. smoothing: (K,), variance of a
    cell over that of one rectified from the picture itself. blur: (K,), share of a cell's
    difference from the mean of its two neighbours along x that it has lost.
    """

    cells: NDArray[np.float32]
    window: FloatArray
    smoothing: FloatArray
    blur: FloatArray


class CellSource(Protocol):
    """Light of the cells of a run, from what it has kept.

    without_dark: exposures in seconds of which the record has a mean alone. u_height: relative, of
    a height that the cells show.
    """

    without_dark: set[float]
    u_height: float

    def steps(self) -> set[int]:
        """Return the steps whose cells can be had."""

    def require(self, readings: Sequence[Reading]) -> None:
        """Raise `InputError` that names what is missing of these readings."""

    def search_grid(self) -> CellGrid:
        """Return the cells in which the height of the surface is looked for."""

    def light(
        self, readings: Sequence[Reading], grid: CellGrid, height_mm: float = 0.0
    ) -> CellLight:
        """Return the light, in DN, of the cells (K, rows, columns) of a surface at a height."""


class KeptCells:
    """Cells that a scan with `maps` has gathered, by step.

    Raises `InputError` for cells of another size than the protocol's.
    """

    def __init__(self, record: Record, loaded: Loaded, grid: CellGrid) -> None:
        maps = loaded.protocol.maps
        self._run, self._grid, self._pinhole = record.folder, grid, Pinhole.of(loaded.rig)
        self.without_dark: set[float] = set()
        self.u_height = _U_HEIGHT
        if maps is None or grid != CellGrid.of(loaded.protocol.sample, loaded.rig, maps.cell_mm):
            kept = "none" if maps is None else f"of {maps.cell_mm:g} mm"
            raise InputError(
                f"{record.folder}: cells of {grid.cell_mm:g} mm asked for, but the scan gathered "
                f"{kept}; allowed: those, or a run with keep_frames: true"
            )
        self._steps = {r.step for r in record.readings() if self._path(r.step).is_file()}

    def steps(self) -> set[int]:
        """Return the steps whose cells are in the run's folder."""
        return self._steps

    def require(self, readings: Sequence[Reading]) -> None:
        """Do nothing: only readings with cells are asked for."""

    def search_grid(self) -> CellGrid:
        """Return the cells that were gathered: there are no others."""
        return self._grid

    def light(
        self, readings: Sequence[Reading], grid: CellGrid, height_mm: float = 0.0
    ) -> CellLight:
        """Return the light of the cells (K, rows, columns), in DN, of a band of the rows.

        They were rectified for a surface on the axis, and are moved to the height.
        """
        first = round(float(self._grid.y_mm[0] - grid.y_mm[0]) / grid.cell_mm)
        rows = slice(first, first + grid.rows)
        cells = np.empty((len(readings), grid.rows, grid.columns), dtype=np.float32)
        window = np.empty(len(readings))
        for k, reading in enumerate(readings):
            values = self._read(reading.step)
            whole = values[1:].reshape(self._grid.rows, -1)
            at = at_height(whole, reading.theta_r_deg, height_mm, self._grid, self._pinhole)
            window[k], cells[k] = values[0], at[rows]
        theta_r_deg = np.array([r.theta_r_deg for r in readings])
        moved = smoothing(theta_r_deg, height_mm, grid.cell_mm)
        # Twice what a smooth texture loses: means of cells hide the half of a sharp one.
        return CellLight(cells, window, moved, 1 - moved)

    def _path(self, step: int) -> Path:
        return self._run / cells_name(step)

    def _read(self, step: int) -> NDArray[np.float32]:
        """Return window and cells in one row; raises `InputError` for a file of anything else."""
        size, path = 1 + self._grid.rows * self._grid.columns, self._path(step)
        try:
            data = read_file(path, 4 * size + 4096)
            values = np.load(io.BytesIO(data), allow_pickle=False)
        except (OSError, ValueError, EOFError) as error:
            raise InputError(f"{path}: cannot be read: {error}") from None
        if values.shape != (size,) or values.dtype != np.float32:
            raise InputError(
                f"{path}: {values.shape}, {values.dtype}; allowed: {size} 32-bit floats, as the "
                "scan wrote them"
            )
        return np.asarray(values)


def cell_source(record: Record, loaded: Loaded, grid: CellGrid) -> CellSource:
    """Return the run's kept frames, or else its cells; raises `InputError` without either."""
    if loaded.protocol.maps is not None and not loaded.protocol.keep_frames:
        return KeptCells(record, loaded, grid)
    return KeptFrames(record, loaded, grid)


class KeptFrames:
    """Frames and darks that a run has kept, by step.

    Raises `InputError` where it has kept none. `without_dark`: exposures in seconds of which the
    record has a mean alone.
    """

    def __init__(self, record: Record, loaded: Loaded, grid: CellGrid) -> None:
        self._grid = grid
        self._run, self._camera = record.folder, loaded.rig.camera
        self._pinhole, self._protocol = Pinhole.of(loaded.rig), loaded.protocol
        self._names = _by_step(record)
        self._means = {exposure_s: mean for exposure_s, _, mean, _ in record.darks()}
        self._darks: dict[float, tuple[FloatImage | float, BoolArray | None]] = {}
        self.without_dark: set[float] = set()
        self.u_height = 0.0

    def steps(self) -> set[int]:
        """Return the steps whose frames were kept."""
        return set(self._names)

    def require(self, readings: Sequence[Reading]) -> None:
        """Raise `InputError` that names the kept files of these readings that are missing."""
        names = [name for r in readings for name in self._names.get(r.step, ())]
        lost = [name for name in names if not (self._run / name).is_file()]
        if lost:
            more = f" and {len(lost) - _SHOWN} more" if len(lost) > _SHOWN else ""
            raise InputError(
                f"{self._run}: {len(lost)} of {len(names)} frames that the record names are "
                f"missing: {', '.join(lost[:_SHOWN])}{more}: put them back into the run's folder"
            )

    def search_grid(self) -> CellGrid:
        """Return a grid of cells as small as the pixels, or of `_SEARCHED` along a side."""
        grid, pixel_mm = self._grid, self._camera.field_width_mm / self._camera.width_px
        side_mm = max(grid.rows, grid.columns) * grid.cell_mm
        cell_mm = min(grid.cell_mm, max(pixel_mm, side_mm / _SEARCHED))
        rows, columns = (int(n * grid.cell_mm / cell_mm) for n in (grid.rows, grid.columns))
        return CellGrid(cell_mm, rows, columns)

    def light(
        self, readings: Sequence[Reading], grid: CellGrid, height_mm: float = 0.0
    ) -> CellLight:
        """Return the light of the cells in these readings, whose darks are read first."""
        for exposure_s in {r.exposure_s for r in readings}:
            self._darks.setdefault(exposure_s, self._dark(exposure_s))
        cells = np.empty((len(readings), grid.rows, grid.columns), dtype=np.float32)
        window = np.empty(len(readings))

        def read(k: int) -> None:
            window[k], cells[k] = self._cells(readings[k], grid, height_mm)

        with ThreadPoolExecutor(_WORKERS) as pool:
            for _ in pool.map(read, range(len(readings))):
                pass
        return CellLight(cells, window, np.ones(len(readings)), np.zeros(len(readings)))

    def _cells(
        self, reading: Reading, grid: CellGrid, height_mm: float
    ) -> tuple[float, FloatImage]:
        """Return the light of the window and of the cells (rows, columns), in DN."""
        images = [self._image(name) for name in self._names[reading.step]]
        dark, hot = self._darks[reading.exposure_s]
        light = light_dn(images, dark, hot, self._camera, self._pinhole)
        return cells_of(
            light, images[0], reading.theta_r_deg, grid, self._pinhole, self._protocol, height_mm
        )

    def _dark(self, exposure_s: float) -> tuple[FloatImage | float, BoolArray | None]:
        name = dark_name(exposure_s)
        if (self._run / name).is_file():
            dark = self._image(name, np.dtype(np.float32))
            return dark, find_hot_pixels(dark.astype(np.float64), self._camera)
        self.without_dark.add(exposure_s)
        return self._means.get(exposure_s, float(self._camera.black_level_dn)), None

    def _image(self, name: str, kind: np.dtype[Any] | None = None) -> NDArray[Any]:
        """Return the picture in a file, (rows, columns); raises `InputError` for any other."""
        import cv2

        path, shape = self._run / name, (self._camera.height_px, self._camera.width_px)
        least = np.dtype(np.uint8 if self._camera.bit_depth == 8 else np.uint16)
        try:
            data = np.frombuffer(read_file(path, 16 * shape[0] * shape[1] + 65536), np.uint8)
            image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: cannot be read: {error}") from None
        if image is None or image.shape != shape or image.dtype != (kind or least):
            found = "no picture" if image is None else f"{image.shape}, {image.dtype}"
            raise InputError(
                f"{path}: {found}; allowed: a TIFF of {shape} and {kind or least}, as the scan "
                "wrote it"
            )
        return np.asarray(image)


def _by_step(record: Record) -> Mapping[int, list[str]]:
    """Return the names of the kept frames by step; raises `InputError` where there are none."""
    found: dict[int, list[str]] = {}
    for name in record.frame_files():
        step = step_of(name)
        if step is not None:
            found.setdefault(step, []).append(name)
    if not found:
        raise InputError(
            f"{record.folder}: the frames of this run were not kept, and a map needs them; "
            "allowed: a run whose protocol has keep_frames: true, or maps"
        )
    return found
