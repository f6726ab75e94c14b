"""Shadows lie where geometry says, and shapes have the surface that they state."""

import math

import numpy as np
import pytest

from analysis.rendering.light import HEADLIGHT, light
from analysis.rendering.shadows import lit
from analysis.rendering.shapes import SHAPES, cube, cylinder, vase, vase_radius
from analysis.rendering.surface import Surface
from instrument.geometry import BoolArray

RNG = np.random.default_rng(24)


def on_a_table(half: float) -> Surface:
    """A cube on a table, seen from above."""
    x = np.linspace(-2, 2, 161)
    y = -x
    height = np.where(np.maximum(np.abs(x), np.abs(y)[:, None]) <= half, 2 * half, 0.0)
    normal = np.broadcast_to([0.0, 0.0, 1.0], (161, 161, 3))
    return Surface(name="cube", x=x, y=y, height=height, normal=normal, convex=False)


def shadow_of_cube(surface: Surface, half: float, theta: float, phi: float) -> BoolArray:
    """Places on the table whose ray to the lamp meets the cube: its slabs, in closed form."""
    start, end = np.zeros((161, 161)), np.full((161, 161), 2 * half * math.tan(theta))
    places = np.meshgrid(surface.x, surface.y)
    for place, slope in zip(places, (math.cos(phi), math.sin(phi)), strict=True):
        one, other = ((sign * half - place) / slope for sign in (-1, 1))
        start = np.maximum(start, np.minimum(one, other))
        end = np.minimum(end, np.maximum(one, other))
    return np.asarray(start < end)


@pytest.mark.parametrize("_", range(4))
def test_the_shadow_of_a_cube_on_a_table_is_its_projection(_: int) -> None:
    theta, phi = RNG.uniform(20, 70), RNG.uniform(0, 360)
    surface, half = on_a_table(0.4), 0.4
    dark = ~lit(surface, light(theta, phi))
    angles = math.radians(theta), math.radians(phi)
    margin = 1.5 * surface.pixel
    inner = shadow_of_cube(surface, half - margin, *angles) & (surface.height == 0)
    outer = shadow_of_cube(surface, half + margin, *angles)
    assert inner.sum() > 100
    assert dark[inner].all()
    assert not dark[~outer].any()
    assert not dark[surface.height > 0].any()


def test_a_lamp_at_the_viewer_casts_no_shadow() -> None:
    for shape in SHAPES.values():
        surface = shape(50)
        assert np.array_equal(lit(surface, HEADLIGHT), surface.seen)
    assert lit(on_a_table(0.4), HEADLIGHT).all()


def test_the_lip_of_the_vase_shades_its_neck() -> None:
    """A ray from the meridian to a lamp above stays in its plane: it meets the profile, or not."""
    surface, theta = vase(301), math.radians(60)
    found = lit(surface, light(60, 90))[:, 150]
    profile = np.linspace(-1.5, 1.5, 4001)
    radius, slope = vase_radius(profile)
    for row in np.flatnonzero(surface.seen[:, 150])[::7]:
        y = surface.y[row]
        at, steep = (array[0] for array in vase_radius(surface.y[row : row + 1]))
        above = profile > y + 2 * surface.pixel
        clearance = at + (profile - y) / math.tan(theta) - radius
        lowest = float(np.min(clearance[above], initial=1.0))
        facing = math.cos(theta) - math.sin(theta) * steep
        if min(abs(lowest), abs(facing)) > 0.02:  # elsewhere a pixel decides
            assert found[row] == (lowest > 0 and facing > 0)
    assert found.any()
    assert not found[surface.seen[:, 150]].all()
    assert np.any(slope > 0)


def test_normals_are_those_of_the_heights() -> None:
    for shape in SHAPES.values():
        surface = shape(250)
        found = Surface.from_height("", surface.x, surface.y, surface.height).normal
        agree = np.sum(found * surface.normal, axis=-1)
        inside = np.isfinite(agree) & (surface.normal[..., 2] > 0.3)
        assert np.linalg.norm(surface.normal[surface.seen], axis=-1) == pytest.approx(1)
        assert np.percentile(agree[inside], 3) > 0.998


def test_a_cube_shows_as_many_faces_as_are_turned_to_the_viewer() -> None:
    for turn, tilt, faces in ((0, 0, 1), (30, 0, 2), (-30, 25, 3), (0, 20, 2)):
        surface = cube(60, turn, tilt)
        normals = np.unique(np.round(surface.normal[surface.seen], 9), axis=0)
        assert len(normals) == faces
        area = surface.seen.sum() * surface.pixel**2
        assert area == pytest.approx(1.7**2 * normals[:, 2].sum(), rel=0.05)


def test_shapes_refuse_what_they_cannot_show() -> None:
    with pytest.raises(ValueError, match="tilt_deg = 80 degrees; allowed: 0 to 60"):
        cylinder(40, tilt_deg=80)
    with pytest.raises(ValueError, match="size = 1 pixels; allowed: 2 or more"):
        cube(1)
