"""Where the measuring window dies: what is left of it, and how wrong it gets, towards grazing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from acquisition.benchmark.maps.map_style import MapPicture, columns_of, joined
from acquisition.measure.window import window_at
from analysis.report.style import BAND, GREY, INK, style_of, svg_of
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole, apply_homography

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FEW_PIXELS = 100.0
"""A protocol's least number of pixels, where it says nothing else."""
TOLERABLE = 1e-3
"""The window's promise: the mean is the patch's radiance to a thousandth."""

PATCHES_MM = (20.0, 5.0)
VIEWS_DEG = np.concatenate([np.arange(0.0, 80.0, 2.5), np.arange(80.0, 89.6, 0.25)])

_LAMP_DEG, _LAMP_MM = 45.0, 1000.0  # whose light falls off over the patch


class Camera(NamedTuple):
    """A shipped rig's camera: picture's width and height in pixels, field and beam in mm."""

    name: str
    pinhole: Pinhole


CAMERAS = (
    Camera(
        "bench_12bit",
        Pinhole(
            beam_length_mm=800.0,
            field_width_mm=72.0,
            width_px=640,
            height_px=512,
            axis_column_px=317.0,
            axis_row_px=257.5,
            roll_deg=0.4,
        ),
    ),
    Camera(
        "paper_1995",
        Pinhole(
            beam_length_mm=1828.8,
            field_width_mm=90.0,
            width_px=512,
            height_px=480,
            axis_column_px=255.5,
            axis_row_px=239.5,
            roll_deg=0.0,
        ),
    ),
)
"""Those of the rigs that the program comes with: written here, as a bench may be run far from the
folder of the rig files."""


def window_picture() -> MapPicture:
    """Pixels in the window and its bias against the view angle, for rigs and patches."""
    lines = list(_lines())

    def draw(figure: Figure) -> None:
        height = figure.get_size_inches()[1]
        grid = {"left": 0.085, "right": 0.985, "top": 1 - 0.62 / height, "bottom": 0.52 / height,
                "wspace": 0.24}  # fmt: skip
        left, right = figure.subplots(1, 2, gridspec_kw=grid)
        for k, (label, pixels, bias) in enumerate(lines):
            colour, marker, dashes = style_of(k)
            style = {
                "color": colour,
                "linestyle": dashes,
                "marker": marker,
                "markevery": 9,
                "ms": 4,
                "linewidth": 1.1,
            }
            left.plot(VIEWS_DEG, pixels, label=label, **style)
            right.plot(VIEWS_DEG, _upper(bias), **style)
        _too_few(left)
        _too_wrong(right)
        figure.legend(loc="upper center", ncols=4, frameon=False, fontsize=8.5, borderaxespad=0.2)

    caption = (
        "Left: whole pixels’ worth in the window of a square patch. Right: by how much the mean "
        f"over its pixels misses the patch’s mean irradiance under a lamp at {_LAMP_DEG:g}°, "
        f"{_LAMP_MM / 1000:g} m away. The window shrinks as cos θᵣ; with few rows left each is "
        "half outside. Below a protocol’s min_pixels the program flags a point and leaves it out."
    )
    rows = [
        columns_of(rig=[label] * VIEWS_DEG.size, theta_r_deg=VIEWS_DEG, pixels=pixels, bias=bias)
        for label, pixels, bias in lines
    ]
    title = "Where the window dies"
    return MapPicture(title, caption, svg_of(3.9, draw, "map_window"), joined(rows))


def _lines() -> Iterator[tuple[str, FloatArray, FloatArray]]:
    for camera in CAMERAS:
        for side_mm in PATCHES_MM:
            found = [pixels_and_bias(camera.pinhole, float(v), side_mm) for v in VIEWS_DEG]
            pixels, bias = np.array(found).T
            yield f"{camera.name}, {side_mm:g} mm", pixels, bias


def pixels_and_bias(pinhole: Pinhole, theta_r_deg: float, side_mm: float) -> tuple[float, float]:
    """Pixels' worth in the window, and the relative error of its mean of the irradiance."""
    window = window_at(theta_r_deg, pinhole, side_mm, side_mm)
    if window.pixels == 0:
        return 0.0, float("nan")
    rows, columns = np.mgrid[window.crop]
    back: FloatArray = np.linalg.inv(pinhole.homography(theta_r_deg)).astype(np.float64)
    points = apply_homography(back, np.stack([columns, rows], axis=-1))
    seen = irradiance(points[..., 0], points[..., 1]) * pinhole.cos4(columns, rows)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    x, y = np.meshgrid(nodes * side_mm / 2, nodes * side_mm / 2)
    true = float(np.sum(irradiance(x, y) * np.outer(weights, weights)) / 4)
    return window.pixels, window.mean(seen) / true - 1


def irradiance(x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    """Of a small lamp at 45 degrees, 1 m away, relative to that on the axis."""
    tilt = np.radians(_LAMP_DEG)
    across, height = _LAMP_MM * np.sin(tilt), _LAMP_MM * np.cos(tilt)
    distance2 = (x_mm - across) ** 2 + y_mm**2 + height**2
    return np.asarray((_LAMP_MM**2 / distance2) ** 1.5)


def _upper(bias: FloatArray) -> FloatArray:
    """Its size, the largest of each place and its neighbours: it goes through zero often."""
    size = np.maximum(np.abs(bias), 1e-7)
    near = np.lib.stride_tricks.sliding_window_view(np.pad(size, 2, mode="edge"), 5)
    return np.asarray(near.max(axis=-1))


def _too_few(ax: Axes) -> None:
    ax.set_yscale("log")
    ax.axhspan(1.0, FEW_PIXELS, color=BAND, zorder=0)
    ax.axhline(FEW_PIXELS, color=GREY, linewidth=0.8)
    words = f"grazing: fewer than {FEW_PIXELS:g} pixels,\nflagged and not fitted"
    ax.text(3, 22, words, size=8.5, color=INK, va="center")
    ax.set_ylim(5, 1e5)
    ax.set_yticks([10, 100, 1000, 10_000, 100_000], ["10", "100", "1000", "10⁴", "10⁵"])
    _views(ax)
    ax.set_ylabel("pixels in the window")


def _too_wrong(ax: Axes) -> None:
    ax.set_yscale("log")
    ax.axhspan(TOLERABLE, 1.0, color=BAND, zorder=0)
    ax.axhline(TOLERABLE, color=GREY, linewidth=0.8)
    ax.text(3, 5e-3, "more than the window promises", size=8.5, color=INK, va="center")
    ax.set_ylim(1e-7, 3e-2)
    ax.set_yticks([1e-6, 1e-5, 1e-4, 1e-3, 1e-2], ["10⁻⁶", "10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²"])
    _views(ax)
    ax.set_ylabel("|bias| of the window’s mean")


def _views(ax: Axes) -> None:
    ax.set_xlim(0, 90)
    ax.set_xticks([0, 15, 30, 45, 60, 75, 90])
    ax.set_xlabel("view angle θᵣ (°)")
