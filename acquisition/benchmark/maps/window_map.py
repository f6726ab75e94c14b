"""Map of the measuring window towards grazing: pixels left in it, and bias of its mean."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from acquisition.benchmark.maps.map_style import columns_of, joined
from acquisition.benchmark.output.axes_grid import axes_grid
from acquisition.benchmark.result import MapPicture
from acquisition.benchmark.window_truth import (
    LAMP_DEG,
    LAMP_MM,
    irradiance,
    patch_mean,
    shipped_camera,
)
from acquisition.measure.window import window_at
from analysis.report.style import BAND, GREY, INK, style_of, svg_of
from instrument.config.protocol import PatchConfig
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole, apply_homography

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FEW_PIXELS = float(PatchConfig.model_fields["min_pixels"].default)
"""Least number of pixels of a protocol that does not set it."""
TOLERABLE = 1e-3
"""Specification of the window: its mean is the patch's radiance to this relative error."""

RIGS = ("bench_12bit", "paper_1995")
PATCHES_MM = (20.0, 5.0)
VIEWS_DEG = np.concatenate([np.arange(0.0, 80.0, 2.5), np.arange(80.0, 89.6, 0.25)])


def window_picture() -> MapPicture:
    """Map pixels in the window and its bias against the view angle, for rigs and patches."""
    lines: dict[str, tuple[FloatArray, FloatArray]] = {}
    for rig in RIGS:
        for side_mm in PATCHES_MM:
            found = [pixels_and_bias(shipped_camera(rig), float(v), side_mm) for v in VIEWS_DEG]
            pixels, bias = np.array(found).T
            lines[f"{rig}, {side_mm:g} mm"] = (pixels, bias)

    def draw(figure: Figure) -> None:
        left, right = axes_grid(figure, 1, 2, top_in=0.62, left=0.085, wspace=0.24)
        for k, (label, (pixels, bias)) in enumerate(lines.items()):
            colour, marker, dashes = style_of(k)
            style: dict[str, Any] = {
                "color": colour, "linestyle": dashes, "marker": marker, "markevery": 9, "ms": 4,
                "linewidth": 1.1,
            }  # fmt: skip
            left.plot(VIEWS_DEG, pixels, label=label, **style)
            right.plot(VIEWS_DEG, _envelope(bias), **style)
        _frame_pixels(left)
        _frame_bias(right)
        figure.legend(loc="upper center", ncols=4, frameon=False, fontsize=8.5, borderaxespad=0.2)

    caption = (
        "Left: number of whole pixels that the window of a square patch is worth. Right: relative "
        "error of the mean over its pixels against the patch’s mean irradiance, under a lamp at "
        f"{LAMP_DEG:g}°, {LAMP_MM / 1000:g} m away. The window shrinks as cos θᵣ; with few rows "
        "left each is half outside. Below a protocol’s min_pixels a point is flagged and not used."
    )
    rows = [
        columns_of(rig=[label] * VIEWS_DEG.size, theta_r_deg=VIEWS_DEG, pixels=pixels, bias=bias)
        for label, (pixels, bias) in lines.items()
    ]
    title = "Where the measuring window fails"
    return MapPicture(title, caption, svg_of(3.9, draw, "map_window"), joined(rows))


def pixels_and_bias(pinhole: Pinhole, theta_r_deg: float, side_mm: float) -> tuple[float, float]:
    """Return the pixels' worth in the window, and its relative error of the mean irradiance."""
    window = window_at(theta_r_deg, pinhole, side_mm, side_mm)
    if window.pixels == 0:
        return 0.0, float("nan")
    rows, columns = np.mgrid[window.crop]
    back: FloatArray = np.linalg.inv(pinhole.homography(theta_r_deg)).astype(np.float64)
    points = apply_homography(back, np.stack([columns, rows], axis=-1))
    image = irradiance(points) * pinhole.cos4(columns, rows)
    return window.pixels, window.mean(image) / patch_mean(irradiance, side_mm) - 1


def _envelope(bias: FloatArray) -> FloatArray:
    """|bias|, largest of each view and its neighbours, as it passes through zero often."""
    size = np.maximum(np.abs(bias), 1e-7)
    near = np.lib.stride_tricks.sliding_window_view(np.pad(size, 2, mode="edge"), 5)
    return np.asarray(near.max(axis=-1))


def _frame_pixels(ax: Axes) -> None:
    _frame(ax, (1.0, FEW_PIXELS), FEW_PIXELS)
    words = f"grazing: fewer than {FEW_PIXELS:g} pixels,\nflagged and not fitted"
    ax.text(3, 22, words, size=8.5, color=INK, va="center")
    ax.set_ylim(5, 1e5)
    ax.set_yticks([10, 100, 1000, 10_000, 100_000], ["10", "100", "1000", "10⁴", "10⁵"])
    ax.set_ylabel("pixels in the window")


def _frame_bias(ax: Axes) -> None:
    _frame(ax, (TOLERABLE, 1.0), TOLERABLE)
    ax.text(3, 5e-3, "outside the window’s specification", size=8.5, color=INK, va="center")
    ax.set_ylim(1e-7, 3e-2)
    ax.set_yticks([1e-6, 1e-5, 1e-4, 1e-3, 1e-2], ["10⁻⁶", "10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²"])
    ax.set_ylabel("|bias| of the window’s mean")


def _frame(ax: Axes, band: tuple[float, float], limit: float) -> None:
    """Draw the band of failure, its limit, and the axis of view angles."""
    ax.set_yscale("log")
    ax.axhspan(*band, color=BAND, zorder=0)
    ax.axhline(limit, color=GREY, linewidth=0.8)
    ax.set_xlim(0, 90)
    ax.set_xticks([0, 15, 30, 45, 60, 75, 90])
    ax.set_xlabel("view angle θᵣ (°)")
