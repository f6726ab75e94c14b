"""Content of the page of a material: everything drawn by its model and by Lambert's law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.rendering.cross_section import across
from analysis.rendering.light import HEADLIGHT, Light, light
from analysis.rendering.lobes import lobes
from analysis.rendering.material import Material
from analysis.rendering.photometric_stereo import Stereo, three_lamps, two_lamps
from analysis.rendering.reflectance_map import ReflectanceMap, reflectance_map
from analysis.rendering.render import render
from analysis.rendering.shapes import SHAPES, cylinder, sphere, vase
from analysis.rendering.surface import Surface
from instrument.geometry import FloatArray

SECTION_LAMPS_DEG = (0.0, 20.0)
"""Lamps of the cross-sections, to the right of the viewer: those of 1995, Figure 24."""

MAP_LAMP_DEG = (10.0, 45.0)
"""Lamp of the reflectance maps, from the viewer and its azimuth: that of 1995, Figure 25."""

LOBES_DEG = (30.0, 60.0)
"""Angles of incidence of the polar lobes."""

_STEREO_PX = 64


@dataclass(frozen=True, slots=True)
class Scene:
    """Lamps that shine at once, and where they stand in words."""

    lamps: Sequence[Light]
    words: str


SCENES = (
    Scene((HEADLIGHT,), "one lamp in the viewer’s direction"),
    Scene((light(45.0, 135.0),), "one lamp 45° from the viewer, above on the left"),
)
"""Scenes of a page by default: the first is that of the vase in 1995, Figure 23."""


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Radiance of the same shape and size by the model and by Lambert's law, of one unit."""

    model: FloatArray
    lambert: FloatArray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Shown:
    """Material and what it looks like.

    pictures: of each scene, by the name of the shape. angles_deg (N,): of normals, to the right of
    the viewer; sections: brightness there, by the lamp's angle. views_deg (M,): signed view angles;
    lobes: by the angle of incidence, and by the name of the part. isophotes: of sphere and upright
    cylinder in the last scene.
    """

    material: Material
    origin: str
    scenes: Sequence[Scene]
    pictures: Sequence[Mapping[str, Pair]]
    angles_deg: FloatArray
    sections: Mapping[float, Pair]
    maps: tuple[ReflectanceMap, ReflectanceMap]
    views_deg: FloatArray
    lobes: Mapping[float, Mapping[str, FloatArray]]
    isophotes: Mapping[str, tuple[Surface, Pair]]
    stereo: tuple[Stereo, Stereo]

    @property
    def flatness(self) -> tuple[float, float]:
        """Brightness at 60 degrees over that of the middle, with the lamp at the viewer.

        By the model and by Lambert's law, which has 0.5.
        """
        pair = self.sections[SECTION_LAMPS_DEG[0]]
        at = [int(np.argmin(np.abs(self.angles_deg - angle))) for angle in (0.0, 60.0)]
        model, lambert = (
            float(curve[at[1]] / curve[at[0]]) for curve in (pair.model, pair.lambert)
        )
        return model, lambert


def show(
    material: Material,
    origin: str,
    *,
    scenes: Sequence[Scene] = SCENES,
    size: int = 200,
    noise: float = 0.005,
) -> Shown:
    """Draw everything. size: of a picture in pixels. noise: relative u of the brightest pixel.

    origin: what the material is, in words.
    """
    angles = np.arange(-89.0, 90.0)
    views = np.arange(-88.0, 88.5)
    map_lamp = [light(*MAP_LAMP_DEG)]
    laws = (material, material.lambert)
    return Shown(
        material=material,
        origin=origin,
        scenes=scenes,
        pictures=[_pictures(material, scene, size) for scene in scenes],
        angles_deg=angles,
        sections={
            at: Pair(*(across(law, [light(at)], angles) for law in laws))
            for at in SECTION_LAMPS_DEG
        },
        maps=(reflectance_map(laws[0], map_lamp), reflectance_map(laws[1], map_lamp)),
        views_deg=views,
        lobes={at: lobes(material.model, material.parameters, at, views) for at in LOBES_DEG},
        isophotes={
            surface.name: (surface, _pair(material, surface, scenes[-1]))
            for surface in (sphere(size), cylinder(size, 0.0))
        },
        stereo=(two_lamps(material, noise), three_lamps(material, vase(_STEREO_PX), noise)),
    )


def _pictures(material: Material, scene: Scene, size: int) -> dict[str, Pair]:
    return {name: _pair(material, shape(size), scene) for name, shape in SHAPES.items()}


def _pair(material: Material, surface: Surface, scene: Scene) -> Pair:
    return Pair(*(render(surface, law, scene.lamps) for law in (material, material.lambert)))
