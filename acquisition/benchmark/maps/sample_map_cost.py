"""Cost of a map of the sample: cells against seconds and memory, and its error against exact fits.

The frames are made up: one picture of noise in place of each, rectified from memory. Reading them
from disk adds about 3 ms a frame of 512 x 480 pixels.
"""

from __future__ import annotations

import time
import tracemalloc
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from acquisition.benchmark.maps.map_style import columns_of
from acquisition.benchmark.output.axes_grid import axes_grid
from acquisition.benchmark.result import MapPicture
from acquisition.measure.rectify.cell_grid import CellGrid
from acquisition.measure.rectify.rectified import rectify
from analysis.data.measurements import Measurements
from analysis.fit.fit import fit
from analysis.models import MODELS
from analysis.report.style import GREY, INK, style_of, svg_of
from analysis.sample_maps.block_fit import CellData, fit_blocks
from analysis.sample_maps.cell_fit import fit_cells
from analysis.sample_maps.places import Places, TableField
from instrument.geometry import FloatArray, camera_direction, lamp_direction
from instrument.pinhole import Pinhole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MODEL = "oren_nayar"
_CAMERA = Pinhole(
    beam_length_mm=1828.8, field_width_mm=90.0, width_px=512, height_px=480,
    axis_column_px=255.5, axis_row_px=239.5, roll_deg=0.0,
)  # fmt: skip
_LAMP_MM, _NOISE = 1000.0, 0.01
_SHARED = 45  # errors that cells share: an angle for each view, lamp, tile, drift
_SIDES = (16, 32, 64, 128, 256, 480)  # rows of cells; columns in the picture's proportion
_EXACT = 120  # cells with an exact fit
_GOAL_S, _GOAL_CELLS = 10.0, 512 * 480


@dataclass(frozen=True, slots=True, kw_only=True)
class MapCost:
    """Costs of maps of N sizes, (N,), and M cells with their exact fits, (M,).

    exact_s: of one exact fit. sigma_deg: true; off_deg: distance of the map from the exact fit.
    """

    cells: FloatArray
    seconds: FloatArray
    megabytes: FloatArray
    exact_s: float
    sigma_deg: FloatArray
    off_deg: FloatArray


def map_cost(sides: tuple[int, ...] = _SIDES, exact: int = _EXACT) -> MapCost:
    """Measure maps of 99 geometries with so many rows of cells, and so many exact fits."""
    theta_i, theta_r = _angles()
    rows = [_cost_of(side, theta_i, theta_r) for side in sides]
    cells, seconds, megabytes = np.array(rows).T
    sigma, off, exact_s = _errors(theta_i, theta_r, exact)
    return MapCost(
        cells=cells, seconds=seconds, megabytes=megabytes, exact_s=exact_s, sigma_deg=sigma,
        off_deg=off,
    )  # fmt: skip


def _angles() -> tuple[FloatArray, FloatArray]:
    grid = np.meshgrid([25.0, 45.0, 65.0], np.linspace(-75, 77, 33), indexing="ij")
    return grid[0].ravel(), grid[1].ravel()


def _places(theta_i: FloatArray, theta_r: FloatArray) -> Places:
    return Places(
        _LAMP_MM * lamp_direction(theta_i, 0.0), _CAMERA.beam_length_mm * camera_direction(theta_r)
    )


def _cost_of(side: int, theta_i: FloatArray, theta_r: FloatArray) -> tuple[float, float, float]:
    """Return cells, wall-clock seconds and megabytes of a map; its memory is traced apart."""
    grid = CellGrid(_CAMERA.field_width_mm / 512 * 480 / side, side, side * 512 // 480)
    begun_s = time.perf_counter()
    _map(grid, theta_i, theta_r)
    seconds = time.perf_counter() - begun_s
    tracemalloc.start()
    _map(grid, theta_i, theta_r)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return grid.rows * grid.columns, seconds, peak / 1e6


def _map(grid: CellGrid, theta_i: FloatArray, theta_r: FloatArray) -> None:
    data, places = _rectified(grid, theta_i, theta_r), _places(theta_i, theta_r)
    half_mm = grid.columns * grid.cell_mm / 2, grid.rows * grid.cell_mm / 2
    fit_blocks(data, TableField.of(_MODEL, places, half_mm), _LAMP_MM)


def _rectified(grid: CellGrid, theta_i: FloatArray, theta_r: FloatArray) -> CellData:
    """Return the cells of a rough surface under noise, rectified from one picture a geometry."""
    random = np.random.default_rng(0)
    noise = 1 + _NOISE * random.standard_normal((_CAMERA.height_px, _CAMERA.width_px))
    light = noise.astype(np.float32)
    middle = _places(theta_i, theta_r).geometry(0.0, 0.0)
    curve = MODELS[_MODEL].brdf(middle, albedo=0.7, sigma_deg=25.0)
    brdf = np.empty((theta_r.size, grid.rows, grid.columns), dtype=np.float32)
    for k, view in enumerate(theta_r.tolist()):
        brdf[k] = np.float32(curve[k]) * rectify(light, grid, _CAMERA, view)
    zero, shape = np.zeros(theta_r.size), brdf.shape[1:]
    return CellData(
        brdf=brdf, x_mm=grid.x_mm, y_mm=grid.y_mm, floor=zero, per_brdf=zero,
        relative=np.full(theta_r.size, _NOISE),
        texture=np.zeros(shape), place_mm=zero, bend=np.zeros(shape), blur=zero,
        shared=_NOISE * random.standard_normal((theta_r.size, _SHARED)), shared_mm=zero,
    )  # fmt: skip


def _errors(
    theta_i: FloatArray, theta_r: FloatArray, count: int
) -> tuple[FloatArray, FloatArray, float]:
    """Return true sigma (M,), distance from the exact fit (M,) in degrees, and seconds of one."""
    random = np.random.default_rng(1)
    places = _places(theta_i, theta_r)
    table = TableField.of(_MODEL, places, (1.0, 1.0)).at(0.0, 0.0)
    m = Measurements.bare(theta_i, theta_r, 0.0, np.ones(theta_r.size), _NOISE)
    sigma, off, taken_s = random.uniform(2, 58, count), np.empty(count), 0.0
    for n in range(count):
        true = {"albedo": float(random.uniform(0.1, 0.95)), "sigma_deg": float(sigma[n])}
        brdf = MODELS[_MODEL].brdf(m.geometry, **true)
        u = _NOISE * brdf
        brdf = brdf + u * random.standard_normal(brdf.size)
        own = Measurements.bare(theta_i, theta_r, 0.0, brdf, u)
        begun_s = time.perf_counter()
        exact = fit(MODELS[_MODEL], own)
        taken_s += time.perf_counter() - begun_s
        mapped = fit_cells(table, brdf[:, np.newaxis], u[:, np.newaxis] ** 2)
        off[n] = abs(float(mapped.sigma_deg[0]) - exact.values["sigma_deg"])
    return sigma, off, taken_s / count


def sample_map_picture() -> MapPicture:
    """Measure maps up to 512 x 480 cells, and draw their cost and error."""
    return picture_of(map_cost())


def picture_of(found: MapCost) -> MapPicture:
    """Draw the costs and errors of maps."""

    def draw(figure: Figure) -> None:
        from matplotlib.ticker import NullFormatter, StrMethodFormatter

        left, middle, right = axes_grid(figure, 1, 3, top_in=0.45, wspace=0.32, left=0.07)
        (_, marker, _), (_, other_marker, _), colour, other = style_of(0), style_of(1), INK, GREY
        left.loglog(found.cells, found.seconds, marker=marker, color=colour, label="map")
        left.loglog(
            found.cells, found.cells * found.exact_s, marker=other_marker, color=other,
            label="exact fit of each cell",
        )  # fmt: skip
        left.plot(_GOAL_CELLS, _GOAL_S, marker="*", color=INK, linestyle="", label="goal")
        left.legend(frameon=False, fontsize=9)
        middle.loglog(found.cells, found.megabytes, marker=marker, color=colour)
        least = np.maximum(found.off_deg, 1e-7)
        right.semilogy(found.sigma_deg, least, marker=marker, color=colour, linestyle="")
        right.axhline(0.05, color=INK, linewidth=1.0)
        for axes, title in zip(
            (left, middle, right), ("seconds", "memory (MB)", "|σ − exact fit| (°)"), strict=True
        ):
            axes.set_title(title, color=INK, loc="left", pad=4)
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_major_formatter(StrMethodFormatter("{x:g}"))
                axis.set_minor_formatter(NullFormatter())
            axes.set_xlabel("true σ (°)" if axes is right else "cells")

    worst = float(np.max(found.off_deg))
    per_cell_us = 1e6 * float(found.seconds[-1] / found.cells[-1])
    sizes = "; ".join(
        f"{cells:.0f} cells {seconds:.2g} s, {megabytes:.3g} MB"
        for cells, seconds, megabytes in zip(
            found.cells, found.seconds, found.megabytes, strict=True
        )
    )
    caption = (
        f"Map of {_MODEL} at 99 geometries, from pictures of 512 × 480 pixels in memory: "
        f"{sizes} ({per_cell_us:.2g} µs a cell); an exact fit takes {1e3 * found.exact_s:.2g} ms.\n"
        f"Right: {found.off_deg.size} random cells; the line is the goal, the worst is "
        f"{worst:.1g}° off."
    )
    columns = columns_of(sigma_deg=found.sigma_deg, off_deg=found.off_deg)
    return MapPicture(
        "What a map of the sample costs", caption, svg_of(3.4, draw, "map_cost"), columns
    )
