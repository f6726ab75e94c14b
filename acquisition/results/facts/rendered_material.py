"""Pictures of a fitted material for its report, and what Lambert's law would cost with it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from analysis.fit.fit import FitResult
from analysis.models import MODELS
from analysis.models.lambert import LAMBERT
from analysis.rendering.light import light
from analysis.rendering.material import Material
from analysis.rendering.photometric_stereo import REACH_DEG, Stereo, two_lamps
from analysis.rendering.render import render
from analysis.rendering.shapes import sphere
from analysis.report.data import Rendered
from analysis.report.style import short_number
from instrument.config.camera import CameraConfig
from instrument.config.load import Loaded

ASSUMED_NOISE = 0.005
"""Relative u of the brightest pixel where no camera is known: 40 000 electrons."""

_SIZE_PX = 160
_THETA_DEG, _PHI_DEG = 20.0, 135.0


def rendered_material(
    result: FitResult | None, noise: float | None
) -> Callable[[], Rendered | None] | None:
    """Return what makes the pictures of a fitted model; None without one, and for Lambert's law.

    noise: relative u of the brightest pixel of a picture; None where no camera is known.
    """
    if result is None or result.model == LAMBERT.name:
        return None
    return partial(_rendered, material_of(result), noise)


def _rendered(material: Material, noise: float | None) -> Rendered | None:
    """Draw the pictures; None for a material that reflects nothing."""
    lamp, surface = light(_THETA_DEG, _PHI_DEG), sphere(_SIZE_PX)
    model = render(surface, material, [lamp])
    if not np.nanmax(model) > 0:
        return None
    stereo = two_lamps(material, ASSUMED_NOISE if noise is None else noise)
    return Rendered(
        name=material.name,
        albedo=material.albedo,
        model=model,
        lambert=render(surface, material.lambert, [lamp]),
        shape="profile of the vase as found",
        places=stereo.places,
        heights=stereo.heights,
        lambert_heights=stereo.by_lambert.heights,
        model_heights=stereo.by_model.heights,
        scene=f"Spheres lit {_THETA_DEG:g}° from the viewer, from above on the left; both on one "
        "scale of brightness, with the screen as bright as the sphere (sRGB).",
        cost=f"{stereo.sentence()} {_noise_sentence(noise, stereo)}",
    )


def material_of(result: FitResult) -> Material:
    """Return the material of a fitted model; a factor of relative values is left out."""
    model = MODELS[result.model]
    values = {p.name: result.values[p.name] for p in model.parameters}
    return Material(model, values, result.model)


def _noise_sentence(noise: float | None, stereo: Stereo) -> str:
    camera = "assumed" if noise is None else "one pixel of this camera in the frames of a point"
    return (
        f"Normals within {REACH_DEG:g}° of the camera count; the brightest pixel has a noise of "
        f"{short_number(100 * stereo.noise, 2)} % ({camera})."
    )


def camera_noise(loaded: Loaded) -> float:
    """Relative u of the brightest pixel of the rig's camera, in the frames of one point."""
    protocol = loaded.protocol
    return pixel_noise(loaded.rig.camera, protocol.exposure_target, protocol.frames_per_point)


def pixel_noise(camera: CameraConfig, exposure_target: float, frames: int) -> float:
    """Relative u of a pixel at `exposure_target` of the full well, in the mean of some frames.

    By photons, read-out and rounding to whole counts.
    """
    electrons = exposure_target * camera.full_well_electrons
    rounding = camera.electrons_per_dn**2 / 12
    variance = electrons + camera.read_noise_electrons**2 + rounding
    return math.sqrt(variance / frames) / electrons
