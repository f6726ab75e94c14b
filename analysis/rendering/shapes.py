"""Shapes of the pictures: sphere, vase, cylinder and cube."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from analysis.rendering.surface import Surface
from instrument.geometry import FloatArray

# Half the side of the square that each picture shows, in radii of the sphere.
_SPHERE_FRAME, _VASE_FRAME, _SOLID_FRAME = 1.03, 1.57, 1.5
_CYLINDER_HALF_HEIGHT = 1.2
_CUBE_HALF_EDGE = 0.85
VASE_HALF_HEIGHT = 1.5
BODY = -0.9, 0.4
"""Lowest and highest y of the vase's body, a cylinder of radius 1."""

# Steps of the vase's radius from its body on: where one begins, where it ends, and its size.
_STEPS = ((-0.9, -1.5, -0.28), (0.4, 1.1, -0.48), (1.1, 1.5, 0.2))


def sphere(size: int = 256) -> Surface:
    """Return a sphere of radius 1, `size` pixels wide and high."""
    x, y = _frame(size, _SPHERE_FRAME)
    height = _root(1 - x**2 - y[:, None] ** 2)
    normal = np.stack(np.broadcast_arrays(x, y[:, None], height), axis=-1)
    return _surface("sphere", x, y, height, normal)


def vase(size: int = 256) -> Surface:
    """Return a vase seen from the side, `size` pixels wide and high.

    Its body is cylindrical, as that of the clay vase of Oren and Nayar 1995 (Figure 23), whose
    other measures the paper does not state: foot, shoulder, neck and lip are made up.
    """
    x, y = _frame(size, _VASE_FRAME)
    radius, slope = vase_radius(y)
    radius = np.where(np.abs(y) <= VASE_HALF_HEIGHT, radius, np.nan)
    height = _root(radius[:, None] ** 2 - x**2)
    normal = np.stack(np.broadcast_arrays(x, (-radius * slope)[:, None], height), axis=-1)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    return _surface("vase", x, y, height, normal, convex=False)


def vase_radius(y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the vase's radius (N,) at heights y (N,), in units of its body's, and its slope."""
    radius, slope = np.ones_like(y), np.zeros_like(y)
    for start, end, change in _STEPS:
        t = np.clip((y - start) / (end - start), 0.0, 1.0)
        radius += change * t * t * (3 - 2 * t)
        slope += change * 6 * t * (1 - t) / (end - start)
    return radius, slope


def cylinder(size: int = 256, tilt_deg: float = 20.0) -> Surface:
    """Return an upright cylinder of radius 1, seen from `tilt_deg` above (0 to 60 degrees).

    `size`: width and height in pixels. Above 0 degrees its lid is seen.
    """
    _require("tilt_deg", tilt_deg, 0.0, 60.0)
    x, y = _frame(size, _SOLID_FRAME)
    up, ahead = math.cos(math.radians(tilt_deg)), math.sin(math.radians(tilt_deg))
    across = _root(1 - x**2) + 0 * y[:, None]
    side = (across + y[:, None] * ahead) / up
    along = y[:, None] * up + side * ahead
    side = np.where(np.abs(along) <= _CYLINDER_HALF_HEIGHT, side, np.nan)
    toward = np.stack(np.broadcast_arrays(x, -across * ahead, across * up), axis=-1)
    if ahead == 0:
        return _surface("cylinder", x, y, side, toward)
    lid = (_CYLINDER_HALF_HEIGHT - y[:, None] * up) / ahead + 0 * x
    inside = x**2 + (lid * up - y[:, None] * ahead) ** 2 <= 1
    height = np.where(inside, lid, side)
    normal = np.where(inside[..., None], np.array([0.0, up, ahead]), toward)
    return _surface("cylinder", x, y, height, normal)


def cube(size: int = 256, turn_deg: float = 30.0, tilt_deg: float = 25.0) -> Surface:
    """Return a cube turned about its upright axis and seen from `tilt_deg` above, in degrees.

    `size`: width and height in pixels. Its front face is turned to the right by `turn_deg` (-60 to
    60), so that three faces are seen, or fewer at 0 degrees; `tilt_deg` from 0 to 60.
    """
    _require("turn_deg", turn_deg, -60.0, 60.0)
    _require("tilt_deg", tilt_deg, 0.0, 60.0)
    x, y = _frame(size, _SOLID_FRAME)
    axes = _cube_axes(math.radians(turn_deg), math.radians(tilt_deg))
    height = np.full((size, size), np.nan)
    normal = np.full((size, size, 3), np.nan)
    for n, face in enumerate(axes):
        if face[2] <= 1e-12:
            continue
        z = (_CUBE_HALF_EDGE - face[0] * x - face[1] * y[:, None]) / face[2]
        others = (axes[(n + k) % 3] for k in (1, 2))
        inside = np.ones((size, size), dtype=bool)
        for other in others:
            place = other[0] * x + other[1] * y[:, None] + other[2] * z
            inside &= np.abs(place) <= _CUBE_HALF_EDGE
        height[inside], normal[inside] = z[inside], face
    return _surface("cube", x, y, height, normal)


SHAPES: Mapping[str, Callable[[int], Surface]] = {
    "sphere": sphere,
    "vase": vase,
    "cylinder": cylinder,
    "cube": cube,
}
"""Shapes by name: each takes the width of its picture in pixels."""


def _cube_axes(turn: float, tilt: float) -> FloatArray:
    """Normals (3, 3) of the front, a side and the top, in radians; each is turned to the viewer."""
    front = np.array([math.sin(turn), 0.0, math.cos(turn)])
    side = np.array([math.cos(turn), 0.0, -math.sin(turn)])
    if side[2] < 0:
        side = -side
    up, ahead = math.cos(tilt), math.sin(tilt)
    tilted = np.array([[1.0, 0.0, 0.0], [0.0, up, -ahead], [0.0, ahead, up]])
    upright = np.stack([front, side, np.array([0.0, 1.0, 0.0])])
    return np.asarray(upright @ tilted.T)


def _frame(size: int, half: float) -> tuple[FloatArray, FloatArray]:
    """Places of the centres of pixels: x (size,) rising and y (size,) falling."""
    if size < 2:
        raise ValueError(f"size = {size} pixels; allowed: 2 or more")
    x = half * ((np.arange(size) + 0.5) * 2 / size - 1)
    return x, -x


def _root(square: FloatArray) -> FloatArray:
    """Square root, NaN where there is none, and on the very edge, whose normal is not seen."""
    return np.sqrt(np.where(square > 0, square, np.nan))


def _surface(
    name: str,
    x: FloatArray,
    y: FloatArray,
    height: FloatArray,
    normal: FloatArray,
    *,
    convex: bool = True,
) -> Surface:
    seen = np.isfinite(height)[..., None]
    normal = np.where(seen, normal, np.nan)
    return Surface(name=name, x=x, y=y, height=height, normal=normal, convex=convex)


def _require(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{name} = {value:g} degrees; allowed: {low:g} to {high:g} degrees")
