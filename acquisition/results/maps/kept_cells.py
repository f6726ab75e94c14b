"""Light of the cells in each reading of a run, from the frames that it has kept."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.hot_pixels import find_hot_pixels
from acquisition.measure.rectify.cell_grid import CellGrid
from acquisition.measure.rectify.kept_files import cells_name, dark_name, step_of
from acquisition.measure.rectify.light import FloatImage, channels_of, light_dn, window_dn
from acquisition.measure.rectify.of_sample import cells_of
from acquisition.results.maps.surface_height import at_height, smoothing
from instrument.config.camera import CameraConfig
from instrument.config.load import Loaded
from instrument.devices import GREEN, mono_picture
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
        self,
        readings: Sequence[Reading],
        grid: CellGrid,
        height_mm: float = 0.0,
        channels: Sequence[int] | None = None,
    ) -> list[CellLight]:
        """Return the light, in DN, of the cells (K, rows, columns) of a surface at a height.

        channels: of a colour camera, those wanted; None for that of the mono picture.
        """

    def tile_windows(self, readings: Sequence[Reading]) -> FloatArray:
        """Return the light (K, 3), in DN, of the window in readings of a tile, by channel.

        Raises `InputError` for those that were not kept.
        """


def _wanted(channels: Sequence[int] | None, camera: CameraConfig) -> tuple[int, ...]:
    """Return the numbers of the channels wanted; that of the mono picture for None."""
    return tuple(channels) if channels is not None else (GREEN if camera.is_colour else 0,)


class KeptCells:
    """Cells that a scan with `maps` has gathered, by step.

    Raises `InputError` for cells of another size than the protocol's.
    """

    def __init__(self, record: Record, loaded: Loaded, grid: CellGrid) -> None:
        maps = loaded.protocol.maps
        self._run, self._grid, self._pinhole = record.folder, grid, Pinhole.of(loaded.rig)
        self._camera = loaded.rig.camera
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
        self,
        readings: Sequence[Reading],
        grid: CellGrid,
        height_mm: float = 0.0,
        channels: Sequence[int] | None = None,
    ) -> list[CellLight]:
        """Return the light of the cells (K, rows, columns), in DN, of a band of the rows.

        They were rectified for a surface on the axis, and are moved to the height.
        """
        first = round(float(self._grid.y_mm[0] - grid.y_mm[0]) / grid.cell_mm)
        rows, wanted = slice(first, first + grid.rows), _wanted(channels, self._camera)
        cells = np.empty((len(wanted), len(readings), grid.rows, grid.columns), dtype=np.float32)
        window, each = np.empty((len(wanted), len(readings))), self._camera.channels
        size = 1 + self._grid.rows * self._grid.columns
        for k, reading in enumerate(readings):
            values = self._read(reading.step, each * size).reshape(each, size)[list(wanted)]
            for n, own in enumerate(values):
                whole = own[1:].reshape(self._grid.rows, -1)
                at = at_height(whole, reading.theta_r_deg, height_mm, self._grid, self._pinhole)
                window[n, k], cells[n, k] = own[0], at[rows]
        theta_r_deg = np.array([r.theta_r_deg for r in readings])
        moved = smoothing(theta_r_deg, height_mm, grid.cell_mm)
        # Twice what a smooth texture loses: means of cells hide the half of a sharp one.
        return [CellLight(*own, moved, 1 - moved) for own in zip(cells, window, strict=True)]

    def tile_windows(self, readings: Sequence[Reading]) -> FloatArray:
        """Return the light (K, 3), in DN, of the window in readings of a tile, by channel."""
        return np.array([self._read(r.step, self._camera.channels) for r in readings], np.float64)

    def _path(self, step: int) -> Path:
        return self._run / cells_name(step)

    def _read(self, step: int, size: int) -> NDArray[np.float32]:
        """Return windows and cells in one row; raises `InputError` for a file of anything else."""
        path = self._path(step)
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
        self._darks: dict[float, list[tuple[FloatImage | float, BoolArray | None]]] = {}
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
        self,
        readings: Sequence[Reading],
        grid: CellGrid,
        height_mm: float = 0.0,
        channels: Sequence[int] | None = None,
    ) -> list[CellLight]:
        """Return the light of the cells in these readings, whose darks are read first."""
        self._read_darks(readings)
        wanted, count = _wanted(channels, self._camera), len(readings)
        cells = np.empty((len(wanted), count, grid.rows, grid.columns), dtype=np.float32)
        window = np.empty((len(wanted), count))

        def read(k: int) -> None:
            found = self._cells(readings[k], grid, height_mm, wanted)
            for n, (own_window, own) in enumerate(found):
                window[n, k], cells[n, k] = own_window, own

        with ThreadPoolExecutor(_WORKERS) as pool:
            for _ in pool.map(read, range(count)):
                pass
        each = zip(cells, window, strict=True)
        return [CellLight(*own, np.ones(count), np.zeros(count)) for own in each]

    def tile_windows(self, readings: Sequence[Reading]) -> FloatArray:
        """Return the light (K, 3), in DN, of the window in readings of a tile, by channel."""
        self.require(readings)
        self._read_darks(readings)
        found, patch = [], self._protocol.window
        for r in readings:
            lights = self._lights(r, self._pictures(r), range(self._camera.channels))
            found.append([window_dn(own, r.theta_r_deg, self._pinhole, patch) for own in lights])
        return np.array(found)

    def _cells(
        self, reading: Reading, grid: CellGrid, height_mm: float, channels: Sequence[int]
    ) -> Iterator[tuple[float, FloatImage]]:
        """Yield the light of the window and of the cells (rows, columns), in DN, by channel."""
        pictures, camera = self._pictures(reading), self._camera
        image = mono_picture(pictures[0], camera.max_dn) if camera.is_colour else pictures[0]
        for light in self._lights(reading, pictures, channels):
            yield cells_of(
                light, image, reading.theta_r_deg, grid, self._pinhole, self._protocol, height_mm
            )

    def _pictures(self, reading: Reading) -> list[NDArray[Any]]:
        return [self._picture(name) for name in self._names[reading.step]]

    def _lights(
        self, reading: Reading, pictures: Sequence[NDArray[Any]], channels: Sequence[int]
    ) -> Iterator[FloatImage]:
        """Yield the light of each pixel (rows, columns), in DN, in these channels."""
        each = list(zip(*(channels_of(picture) for picture in pictures), strict=True))
        for channel in channels:
            dark, hot = self._darks[reading.exposure_s][channel]
            yield light_dn(each[channel], dark, hot, self._camera, self._pinhole)

    def _read_darks(self, readings: Sequence[Reading]) -> None:
        for exposure_s in {r.exposure_s for r in readings} - self._darks.keys():
            self._darks[exposure_s] = self._dark(exposure_s)

    def _dark(self, exposure_s: float) -> list[tuple[FloatImage | float, BoolArray | None]]:
        name = dark_name(exposure_s)
        if (self._run / name).is_file():
            darks = channels_of(self._picture(name, np.dtype(np.float32)))
            return [(own, find_hot_pixels(own.astype(np.float64), self._camera)) for own in darks]
        self.without_dark.add(exposure_s)
        mean = self._means.get(exposure_s, float(self._camera.black_level_dn))
        return [(mean, None)] * self._camera.channels

    def _picture(self, name: str, kind: np.dtype[Any] | None = None) -> NDArray[Any]:
        """Return the picture in a file, (rows, columns) and channels; or raise `InputError`."""
        import cv2

        camera, path = self._camera, self._run / name
        size = camera.height_px, camera.width_px
        shape = (*size, camera.channels) if camera.is_colour else size
        least = np.dtype(np.uint8 if camera.bit_depth == 8 else np.uint16)
        try:
            most = 16 * camera.channels * size[0] * size[1] + 65536
            data = np.frombuffer(read_file(path, most), np.uint8)
            image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: cannot be read: {error}") from None
        if image is None or image.shape != shape or image.dtype != (kind or least):
            found = "no picture" if image is None else f"{image.shape}, {image.dtype}"
            raise InputError(
                f"{path}: {found}; allowed: a TIFF of {shape} and {kind or least}, as the scan "
                "wrote it"
            )
        return np.asarray(image[..., ::-1] if camera.is_colour else image)  # OpenCV has blue first


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
