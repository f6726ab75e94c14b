"""Map of a run's sample: frames to cells, BRDF of each cell, and the fit of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.rectify.cell_grid import CellGrid
from acquisition.results.maps.cell_brdf import (
    cell_data,
    in_own_light,
    leave_out_edges,
    places_of,
    usable,
)
from acquisition.results.maps.channels import (
    ALL,
    Channel,
    Run,
    channels_of_run,
    mean_values,
    shared_by_channels,
)
from acquisition.results.maps.kept_cells import CellLight, CellSource, cell_source
from acquisition.results.maps.mean_curve import MeanCurve
from acquisition.results.maps.surface_height import Height, find_height, searched_views
from acquisition.results.maps.u_shared import UnknownHeight
from acquisition.results.maps.vignetting import Vignetting
from acquisition.results.reduction import Reduced, reduced_run, require_usable
from analysis.sample_maps.block_fit import CellData, fit_blocks
from analysis.sample_maps.colour.channel_fit import fit_channel_blocks
from analysis.sample_maps.places import TableField
from analysis.sample_maps.sample_map import UNITS, SampleMap
from instrument.config.load import Loaded
from instrument.errors import InputError, NotDetermined
from instrument.geometry import BoolArray, FloatArray
from instrument.record.record import Record

_USUAL_MM = 0.5
_MOST_BYTES = 400 * 1024**2  # of the cells that are in memory at a time
_LEAST_U_MM = 0.02  # of a height that the texture shows: what else moves a picture (assumed)


def map_sample(
    record: Record, loaded: Loaded, model: str, cell_mm: float | None = None
) -> SampleMap:
    """Fit the model in each cell of the run's sample.

    cell_mm: side of a cell; None for a usual one, or a pixel where that is larger.
    Raises `InputError` where frames were not kept or are missing, or the cells have no size that
    the camera resolves, and `NotDetermined` where the curve does not determine the model.
    """
    cell_mm = usual_cell_mm(loaded) if cell_mm is None else cell_mm
    grid = CellGrid.of(loaded.protocol.sample, loaded.rig, cell_mm)
    frames = cell_source(record, loaded, grid)
    reduced = reduced_run(record, loaded)
    require_usable(reduced)
    kept = reduced.valid & _has_frames(reduced, frames) & usable(reduced.points, grid, loaded.rig)
    if not kept.any():
        raise NotDetermined(
            f"{record.folder}: no reading with kept frames resolves cells of {cell_mm:g} mm: name "
            "larger ones"
        )
    run = Run(record, loaded, frames, _subset(reduced, kept), kept)
    frames.require(run.readings)
    curve = MeanCurve.of(run.reduced, loaded, model)
    return _Mapping(run, curve, grid).made(reduced)


def usual_cell_mm(loaded: Loaded) -> float:
    """Return the side of a cell where none is named: the protocol's, or a usual one."""
    if loaded.protocol.maps is not None:
        return loaded.protocol.maps.cell_mm
    camera = loaded.rig.camera
    return max(_USUAL_MM, camera.field_width_mm / camera.width_px)


def _has_frames(reduced: Reduced, frames: CellSource) -> BoolArray:
    steps = frames.steps()
    return np.array([p.step in steps for p in reduced.points], dtype=bool)


def _subset(reduced: Reduced, kept: BoolArray) -> Reduced:
    """Return the run with all other points flagged, so that no fit uses them."""
    flags = tuple(
        flag or ("" if own else "not mapped") for flag, own in zip(reduced.flags, kept, strict=True)
    )
    return replace(reduced, flags=flags)


class _Mapping:
    """Mapping of one run, in bands of rows that memory holds."""

    def __init__(
        self,
        run: Run,
        curve: MeanCurve,
        grid: CellGrid,
    ) -> None:
        self._run, self._frames, self._loaded = run, run.source, run.loaded
        self._readings, self._curve, self._grid = run.readings, curve, grid
        self._theta_r_deg = np.array([r.theta_r_deg for r in self._readings])
        # Nothing but a white tile tells the responses of the channels.
        self._in_colour = run.loaded.rig.camera.is_colour and not curve.relative
        self._channels = [] if self._in_colour else [Channel(self._readings, curve)]

    def made(self, reduced: Reduced) -> SampleMap:
        """Return the map."""
        height = self._height()
        tables, maps = self._tables(height), []
        wanted = ALL if self._in_colour else None
        for band in self._bands():
            lights = self._frames.light(self._readings, band, height.mm, wanted)
            if not self._channels:
                self._channels = channels_of_run(self._run, lights, self._curve)
            data = [
                self._data(channel, light, band, height)
                for channel, light in zip(self._channels, lights, strict=True)
            ]
            if self._in_colour:
                maps.append(fit_channel_blocks(data, tables, self._nearest_mm()))
            else:
                maps.append(fit_blocks(data[0], tables, self._nearest_mm()))
        whole = {name: np.concatenate([m[name] for m in maps]) for name in maps[0]}
        return self._as_map(whole, data, height, reduced)

    def _data(self, channel: Channel, light: CellLight, band: CellGrid, height: Height) -> CellData:
        """Return the cells of a band of rows in one channel."""
        data = cell_data(light, channel.readings, channel.curve, band, self._loaded)
        data = in_own_light(data, channel.readings, height, light.blur, self._loaded.rig)
        return self._with_shared(data, height)

    def _tables(self, height: Height) -> TableField:
        grid, places = self._grid, places_of(self._readings, self._loaded.rig, height.mm)
        half_mm = grid.columns * grid.cell_mm / 2, grid.rows * grid.cell_mm / 2
        return TableField.of(self._curve.fit.model, places, half_mm)

    def _u_height(self, height: Height) -> float:
        """Return u of the height in units of the rig's placement; markers hide where it is."""
        if self._loaded.protocol.markers is not None:
            return 1.0
        u_placement_mm = self._loaded.rig.u_placement_mm
        return min(height.u_mm / u_placement_mm, 1.0) if u_placement_mm else 0.0

    def _bands(self) -> list[CellGrid]:
        per_row = 4 * len(self._readings) * self._grid.columns
        rows = max(1, _MOST_BYTES // (per_row * (len(ALL) if self._in_colour else 1)))
        return [self._grid.band(k, k + rows) for k in range(0, self._grid.rows, rows)]

    def _with_shared(self, data: CellData, height: Height) -> CellData:
        """Return the cells with the shifts by what they share, relative to their curves."""
        errors = self._curve.errors(self._u_height(height))
        brdf = np.abs(self._curve.brdf)[:, np.newaxis]
        u_mm = min(height.u_mm, self._loaded.rig.u_placement_mm)
        moved_mm = u_mm * np.tan(np.radians(self._theta_r_deg))
        return replace(data, shared=errors / brdf, shared_mm=moved_mm)

    def _height(self) -> Height:
        """Return the height of the surface, as its texture shows it in some of the readings."""
        theta_r_deg, u_mm = self._theta_r_deg, self._loaded.rig.u_placement_mm
        some = searched_views(theta_r_deg)
        readings, grid = [self._readings[k] for k in some], self._frames.search_grid()

        def light(height_mm: float) -> NDArray[np.float32]:
            (found,) = self._frames.light(readings, grid, height_mm)
            found.cells[...] /= found.window[:, np.newaxis, np.newaxis]
            leave_out_edges(found.cells, readings, grid, self._loaded)
            return found.cells

        found = find_height(light, theta_r_deg[some], grid.cell_mm, u_mm)
        u_mm = np.hypot(max(found.u_mm, _LEAST_U_MM), self._frames.u_height * found.mm)
        return replace(found, u_mm=float(u_mm))

    def _u_shared(
        self, maps: dict[str, FloatArray], data: Sequence[CellData], height: Height
    ) -> dict[str, FloatArray]:
        u_mm = min(height.u_mm, self._loaded.rig.u_placement_mm)
        unknown = UnknownHeight(u_mm, self._u_height(height), self._theta_r_deg)
        u = Vignetting(self._loaded.rig, self._loaded.protocol.window).u_relative(self._grid)
        return shared_by_channels(self._channels, maps, data, unknown, u)

    def _nearest_mm(self) -> float:
        return min(self._loaded.rig.beam_length_mm, self._loaded.rig.lamp_distance_mm)

    def _as_map(
        self,
        maps: dict[str, FloatArray],
        data: Sequence[CellData],
        height: Height,
        reduced: Reduced,
    ) -> SampleMap:
        protocol, curve = self._loaded.protocol, self._curve
        mean = mean_values(self._channels)
        names = sorted(mean, key=list(UNITS).index)
        if not np.isfinite(maps["chi2"]).any():
            unseen = ": two or more markers must be seen in a picture, for it to count"
            raise NotDetermined(
                "no cell has more geometries than the model has parameters"
                + (unseen if protocol.markers is not None else "")
            )
        return SampleMap(
            title=protocol.name,
            sample=protocol.sample.name,
            model=curve.fit.model,
            relative=curve.relative,
            cell_mm=self._grid.cell_mm,
            x_mm=self._grid.x_mm,
            y_mm=self._grid.y_mm,
            values={name: maps[name] for name in names},
            u_own={name: maps[f"u_{name}"] for name in names},
            u_shared=self._u_shared(maps, data, height),
            mean=mean,
            chi2=maps["chi2"],
            count=maps["count"],
            geometries=len(self._readings),
            height_mm=(height.mm, height.u_mm),
            notes=tuple(self._notes(reduced, height)),
        )

    def _notes(self, reduced: Reduced, height: Height) -> list[str]:
        left_out = int(np.sum(reduced.valid)) - len(self._readings)
        found = []
        if left_out:
            found.append(
                f"{left_out} geometries are left out: their frames were not kept, or too grazing "
                "for cells of this size"
            )
        if np.isfinite(height.u_mm):
            found.append(
                f"the texture shows the surface {height.mm:.3f} mm (u {height.u_mm:.3f} mm) above "
                "the axis, and the cells follow it"
            )
        if self._frames.without_dark:
            found.append(
                "the darks of this run were not kept: each exposure's mean dark is subtracted from "
                "all pixels alike"
            )
        if self._curve.relative:
            found.append(
                "no white tile was measured: albedo and ks count relative to one another, and the "
                "lamp's levels are those of the mean curve"
            )
        if self._in_colour:
            found.append(
                "the channels of the camera have one sigma; the white tile is taken as equally "
                "reflecting in all of them"
            )
        elif self._loaded.rig.camera.is_colour:
            found.append(
                "of the colour camera the green channel is mapped: a white tile, which would tell "
                "the responses of the channels, was not measured"
            )
        return found


def require_model(name: str, allowed: Sequence[str]) -> None:
    """Raise `InputError` for a model that a map cannot fit."""
    if name not in allowed:
        raise InputError(f"--model: {name}; allowed for a map: {', '.join(allowed)}")
