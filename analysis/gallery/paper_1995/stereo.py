"""Figures 26 and 27 of the 1995 paper: the vase as photometric stereo recovers it."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from analysis.gallery.figure import Check, Panel, PaperFigure
from analysis.gallery.panels import Axis, Line, chart, sketch
from analysis.rendering.material import Material
from analysis.rendering.photometric_stereo import REACH_DEG, Stereo, two_lamps
from analysis.report.style import GREY, style_of
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Errors by Lambert's law, as computed once for two lamps at 10 degrees: rms of the normals, depth.
_COST = {10.0: (1.6, 0.93), 20.0: (4.1, 0.83), 30.0: (6.3, 0.75), 40.0: (8.1, 0.69)}
_NOISE = 0.002  # of the brightest pixel: some frames of a 12-bit camera
_LENGTH, _LINES = 1.6, 15  # of the body that is drawn, in radii, and lines along it


@cache
def _stereo(sigma_deg: float, noise: float = 0.0) -> Stereo:
    """Stereo of a cylinder; noise: relative u of the brightest pixel."""
    material = Material.named("oren_nayar_exact", albedo=0.70, sigma_deg=sigma_deg)
    return two_lamps(material, noise)


def figure_26() -> PaperFigure:
    """Surfaces recovered by Lambert's law and by the model."""
    found = _stereo(40.0)
    return PaperFigure(
        number="26",
        title="Shape of the vase by photometric stereo",
        caption=(
            "The vase’s body as recovered from two pictures with lamps at −10° and 10° from the "
            "viewer, σ = 40°, albedo 0.7: (a) by Lambert’s law, (b) by the model, which also "
            "rendered the pictures, by the integral (31). Profiles across the body, drawn "
            f"obliquely; surfaces turned by up to {REACH_DEG:g}°; grey: the true one."
        ),
        panels=(
            _body("(a) Lambert’s law", found, found.by_lambert.heights, 1),
            _body("(b) σ = 40°", found, found.by_model.heights, 0),
        ),
        checks=(_model_is_right(), *_by_lambert()),
    )


def _body(title: str, found: Stereo, heights: FloatArray, style: int) -> Panel:
    def draw_into(axes: Axes) -> None:
        for along in np.linspace(_LENGTH, 0.0, _LINES):
            x, up = found.places + 0.45 * along, 0.55 * along
            if along in (0.0, _LENGTH):
                axes.plot(x, found.heights + up, color=GREY, linewidth=1.0)
            axes.plot(x, heights + up, color=style_of(style)[0], linewidth=1.1)
        for k in (0, found.places.size // 2, -1):
            ends = found.places[k] + np.array([0.0, 0.45 * _LENGTH])
            axes.plot(ends, heights[k] + np.array([0.0, 0.55 * _LENGTH]), color=GREY, linewidth=0.6)
        axes.set_xlim(-1.1, 1.9)
        axes.set_ylim(-0.1, 1.65)

    return sketch(title, 2.6, draw_into)


def _model_is_right() -> Check:
    model = _stereo(40.0, _NOISE).by_model
    return Check(
        "the model estimates the shape accurately",
        f"with noise of {100 * _NOISE:g} % in the pictures, normals off by "
        f"{model.normals_off_deg:.1f}° rms and {model.depth:.3f} of the depth; without noise "
        "neither is off",
        model.normals_off_deg < 1.6 and abs(model.depth - 1) < 0.02,
    )


def _by_lambert() -> tuple[Check, Check]:
    lambert = {s: _stereo(s).by_lambert for s in _COST}
    off = [lambert[s].normals_off_deg for s in _COST]
    depth = [lambert[s].depth for s in _COST]
    agrees = all(
        abs(o - known[0]) < 0.1 and abs(d - known[1]) < 0.01
        for o, d, known in zip(off, depth, _COST.values(), strict=True)
    )
    at = ", ".join(f"{s:g}°" for s in _COST)
    return (
        Check(
            "Lambert’s law leads to large errors in the orientation",
            ", ".join(f"{o:.1f}°" for o in off) + f" rms at σ = {at}",
            agrees and off[-1] > 5,
        ),
        Check(
            "and hence in the computed height",
            ", ".join(f"{d:.2f}" for d in depth) + f" of the depth at σ = {at}",
            agrees and depth[-1] < 0.8,
        ),
    )


def figure_27() -> PaperFigure:
    """Profiles across the vase."""
    found = _stereo(40.0)
    profiles = {
        "actual": (found.heights, 4),
        "model, σ = 40°": (found.by_model.heights, 0),
        "Lambert": (found.by_lambert.heights, 1),
    }
    lines = [Line(found.places, y, name, style) for name, (y, style) in profiles.items()]
    worst = float(np.max(np.abs(found.by_lambert.heights - found.heights)))
    same = float(np.max(np.abs(found.by_model.heights - found.heights)))
    return PaperFigure(
        number="27",
        title="Profiles of the vase by photometric stereo",
        caption=(
            "Heights across the body from Figure 26, by the integral (31), σ = 40°, albedo 0.7; "
            "they start at the left end. The profile by the model lies on the actual one."
        ),
        panels=(
            chart(
                "",
                lines,
                Axis("place across the vase, x/R", (-1.0, 1.0), (-1, -0.5, 0, 0.5, 1)),
                Axis("height/R", (0.0, 0.75)),
            ),
        ),
        checks=(
            Check(
                "Lambert’s law produces large errors in the computed shape",
                f"up to {worst:.2f} R, of a height of {float(found.heights.max()):.2f} R",
                worst > 0.15,
            ),
            Check(
                "the profile by the model follows the actual one",
                f"within {same:.4f} R",
                same < 0.01,
            ),
        ),
    )
