"""Sketches of V-cavities to scale, in the cross-section: groove at (0, 0), facets of width 1."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from analysis.models.specular.torrance_sparrow import slope_density
from analysis.report.style import BAND, GREY, INK, style_of
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BLUE, _RED = style_of(0)[0], style_of(1)[0]
_ARROW = {"arrowstyle": "-|>", "linewidth": 1.3, "shrinkA": 0, "shrinkB": 0}


def profile_sketch(axes: Axes, sigma_deg: float, seed: int, count: int = 7) -> None:
    """Cross-section of cavities with slopes drawn at random from (32)."""
    rng = np.random.default_rng(seed)
    theta = np.radians(np.linspace(0.25, 75.0, 300))
    density = slope_density(theta, math.radians(sigma_deg)) * np.sin(theta)
    slopes = np.interp(rng.uniform(size=count), np.cumsum(density) / density.sum(), theta)
    x, y = [0.0], [0.0]
    for slope in slopes:
        x += [x[-1] + np.cos(slope), x[-1] + 2 * np.cos(slope)]
        y += [-np.sin(slope), 0.0]
    axes.fill_between(x, y, -1.35, color=BAND, linewidth=0)
    axes.plot(x, y, color=INK, linewidth=1.5)
    axes.plot([x[0], x[-1]], [0, 0], color=GREY, linewidth=0.7, linestyle=(0, (4, 3)))
    steepest = int(np.argmax(slopes[1:-1])) + 1
    middle = 2 * steepest + 1
    at = np.array([x[middle] - np.cos(slopes[steepest]) / 2, -np.sin(slopes[steepest]) / 2])
    normal = np.array([np.sin(slopes[steepest]), np.cos(slopes[steepest])])
    _arrow(axes, at, at + 1.3 * normal, _BLUE)
    _arrow(axes, at, at + np.array([0, 1.3]), GREY)
    _text(axes, at + 1.4 * normal, "â (θₐ, φₐ)", _BLUE)
    axes.text(at[0] - 0.12, at[1] + 1.3, "n", color=GREY, size=9.5, ha="right")
    axes.text(at[0] + 0.12, at[1] + 0.75, "θₐ", color=INK, size=9.5)
    axes.set_xlim(x[0] - 0.2, x[-1] + 0.2)
    axes.set_ylim(-1.4, 1.5)


def bright_cavity(axes: Axes, slope_deg: float, lamp_deg: float) -> None:
    """Cavity whose facets are as bright as the lamp makes them, and two viewers."""
    slope, lamp = np.radians([slope_deg, lamp_deg])
    rim = np.array([np.cos(slope), np.sin(slope)])
    for side, angle in ((-1, lamp - slope), (1, lamp + slope)):
        facet = np.array([[0, 0], [side * rim[0], rim[1]]])
        axes.plot(*facet.T, color=INK, linewidth=9, solid_capstyle="butt")
        grey = str(round(float(np.clip(np.cos(angle), 0, 1)), 3))
        axes.plot(*facet.T, color=grey, linewidth=6.5, solid_capstyle="butt")
    for start in (-0.55, 0.0, 0.55):
        at = np.array([start, abs(start) * np.tan(slope) + 0.12])
        away = at + 1.0 * np.array([np.sin(lamp), np.cos(lamp)])
        _arrow(axes, away, at, _RED)
    axes.text(1.0, 1.15, "lamp", color=_RED, size=9)
    for angle, word in (
        (-55.0, "sees more of\nthe dark facet"),
        (20.0, "sees more of\nthe bright"),
    ):
        way = np.array([np.sin(np.radians(angle)), np.cos(np.radians(angle))])
        _arrow(axes, 0.45 * way, 1.2 * way, _BLUE)
        _text(axes, 1.25 * way, word, _BLUE, "center" if angle > 0 else "right")
    axes.set_xlim(-2.0, 1.75)
    axes.set_ylim(-0.15, 1.65)


def shadow_sketch(axes: Axes, slope_deg: float, theta_deg: float, word: str, name: str) -> None:
    """Cavity with the ray over one rim, and the part that it leaves hidden on the other facet."""
    slope, theta = np.radians([slope_deg, theta_deg])
    rim = np.array([np.cos(slope), np.sin(slope)])
    other = rim * [-1, 1]
    hidden = -np.cos(slope + theta) / np.cos(slope - theta)
    way = np.array([np.sin(theta), np.cos(theta)])
    axes.plot([other[0], 0, rim[0]], [other[1], 0, rim[1]], color=INK, linewidth=2)
    axes.plot([0, hidden * other[0]], [0, hidden * other[1]], color=_BLUE, linewidth=5)
    for near, far in ((hidden * other, rim + 0.8 * way), (other, other + way)):
        start, end = (near, far) if word == "camera" else (far, near)
        _arrow(axes, start, end, _RED)
    _text(axes, rim + 0.82 * way, word, _RED, "right")
    axes.text(hidden * other[0] / 2 - 0.07, hidden * other[1] / 2 - 0.06, name, color=_BLUE,
              ha="right", va="top", size=11)  # fmt: skip
    axes.text(other[0] / 2 - 0.2, other[1] / 2 + 0.12, "w", color=INK, size=10)
    axes.plot([0, 0], [0, 1.1], color=GREY, linewidth=0.7, linestyle=(0, (4, 3)))
    axes.text(0.03, 1.02, "normal", color=GREY, size=9)
    axes.set_xlim(-1.4, 1.75)
    axes.set_ylim(-0.2, 1.2)


def projection_sketch(axes: Axes) -> None:
    """A direction, the plane across the cavity, and the projection onto it, seen obliquely."""
    ends = np.array([[-1.2, 0, 0], [1.2, 0, 0], [1.2, 0, 1.35], [-1.2, 0, 1.35]])
    axes.fill(*_oblique(ends), color=BAND, linewidth=0)
    for y in (-1.0, 1.0):
        groove = np.array([[-0.8, y, 0], [0, y, -0.5], [0.8, y, 0]])
        axes.plot(*_oblique(groove), color=INK, linewidth=1.4, zorder=2)
    for side, grey in ((-0.8, "#C9C9C9"), (0.8, "#B0B0B0")):
        facet = np.array([[0, -1, -0.5], [side, -1, 0], [side, 1, 0], [0, 1, -0.5]])
        axes.fill(*_oblique(facet), color=grey, linewidth=0, zorder=1)
    for x, z in ((-0.8, 0.0), (0.0, -0.5), (0.8, 0.0)):
        axes.plot(*_oblique(np.array([[x, -1, z], [x, 1, z]])), color=INK, linewidth=1.4)
    theta, phi = np.radians([55.0, 50.0])
    s = 1.35 * np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    origin = np.zeros(3)
    for end, colour in ((s, _RED), (s * [1, 0, 1], _BLUE), (np.array([0, 0, 1.3]), GREY)):
        start, stop = (np.array(_oblique(p[None])).ravel() for p in (origin, end))
        _arrow(axes, start, stop, colour)
    axes.plot(*_oblique(np.array([s, s * [1, 0, 1]])), color=GREY, linestyle=(0, (2, 2)), lw=1)
    for end, word, colour in (
        (s, "s (θ, φ)", _RED),
        (s * [1, 0, 1], "projection, θ′", _BLUE),
        (np.array([0, 0, 1.3]), "n", GREY),
    ):
        x, y = np.array(_oblique(end[None])).ravel()
        axes.text(x + 0.05, y + 0.04, word, color=colour, size=9.5)
    axes.set_xlim(-1.9, 2.2)
    axes.set_ylim(-1.0, 1.75)


def exchange_sketch(axes: Axes) -> None:
    """A point of each facet and the ray between them."""
    slope = np.radians(45.0)
    rim = np.array([np.cos(slope), np.sin(slope)])
    axes.plot([-rim[0], 0, rim[0]], [rim[1], 0, rim[1]], color=INK, linewidth=2)
    x, y = 0.62 * rim * [-1, 1], 0.8 * rim
    _arrow(axes, y, x, _RED)
    for end, word, side in ((x, "x", -1), (y, "y", 1)):
        axes.plot(*end, marker="o", color=_RED, ms=6)
        axes.text(end[0] + side * 0.06, end[1] - 0.1, word, color=_RED, size=11, ha="center")
    for side, m, word in ((-1, 0.25, "mᵥ: not seen"), (1, 0.35, "mˢ: not lit")):
        end = m * rim * [side, 1]
        axes.plot([0, end[0]], [0, end[1]], color=_BLUE, linewidth=5, solid_capstyle="butt")
        axes.text(side * 0.42, 0.03, word, color=_BLUE, size=9.5,
                  ha="left" if side > 0 else "right")  # fmt: skip
    axes.text(0.0, 0.18, "π − 2θₐ", color=INK, size=9.5, ha="center")
    axes.set_xlim(-1.2, 1.2)
    axes.set_ylim(-0.1, 0.9)


def _oblique(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places on paper of points (N, 3)."""
    x, y, z = points.T
    return x + 0.42 * y, z - 0.3 * y


def _arrow(axes: Axes, start: FloatArray, end: FloatArray, colour: str) -> None:
    """Arrow between places (2,) on paper."""
    ends = [(float(x), float(y)) for x, y in (start, end)]
    axes.annotate("", ends[1], ends[0], arrowprops={**_ARROW, "color": colour})


def _text(axes: Axes, at: FloatArray, word: str, colour: str, side: str = "left") -> None:
    axes.text(float(at[0]), float(at[1]), word, color=colour, size=9.5, ha=side, va="bottom")
