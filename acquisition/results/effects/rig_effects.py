"""All effects of a bench that its rig file states, applied to the values of a run.

Expected sizes correct the values; what remains uncertain of them is an error that all points share,
with a shape that is known, so that a fit may find it in the data. Each error is one for a whole
scan, as those of the simulated bench are.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from acquisition.results.effects.effect import Effect, Readings
from acquisition.results.effects.lens import STRAY, VIGNETTING, WALLS, lens_effects
from acquisition.results.effects.polarisation import CAMERA, LAMP, polarisation_effects
from acquisition.results.effects.sensor import NONLINEAR, sensor_effects
from acquisition.results.effects.surface import (
    TILE_TILT,
    TILE_TILT_ACROSS,
    TILT,
    TILT_ACROSS,
    ZEROS,
    surface_effects,
)
from analysis.data.measurements import SharedError
from instrument.config.uncertainty.rig_lines import RigLines
from instrument.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Applied:
    """Factor (N,) by which the values are corrected, and errors of the corrected ones.

    components: relative standard uncertainties (N,) by name, independent from point to point.
    shared: errors that all points share.
    """

    factor: FloatArray
    components: dict[str, FloatArray]
    shared: tuple[SharedError, ...]


def has_effects(lines: RigLines) -> bool:
    """True if the rig file states any effect."""
    return lines != RigLines()


def stated_sizes(lines: RigLines) -> dict[str, tuple[float, float, str]]:
    """Expected size, u and unit of each effect that a fit may find in the data, by its name."""
    percent = {
        NONLINEAR: (0.0, lines.u_linearity),
        VIGNETTING: (lines.vignetting, lines.u_vignetting),
        STRAY: (lines.stray_light, lines.u_stray_light),
        WALLS: (lines.wall_light, lines.u_wall_light),
        LAMP: (0.0, lines.u_polarisation_lamp),
        CAMERA: (0.0, lines.u_polarisation_camera),
    }
    degrees = {
        TILT: lines.u_tilt_deg,
        TILT_ACROSS: lines.u_tilt_across_deg,
        TILE_TILT: lines.u_tile_tilt_deg,
        TILE_TILT_ACROSS: lines.u_tile_tilt_across_deg,
        ZEROS["theta_i"]: lines.u_zero_theta_i_deg,
        ZEROS["dphi"]: lines.u_zero_dphi_deg,
        ZEROS["theta_r"]: lines.u_zero_theta_r_deg,
    }
    found = {name: (100 * size, 100 * u, "%") for name, (size, u) in percent.items() if u}
    return found | {name: (0.0, u, "deg") for name, u in degrees.items() if u}


def rig_effects(readings: Readings) -> Applied:
    """Return the effects of the rig file's section `uncertainty` on the readings' values."""
    count = len(readings.points)
    if not count:
        return Applied(factor=np.ones(0), components={}, shared=())
    effects = [
        *sensor_effects(readings),
        *lens_effects(readings),
        *polarisation_effects(readings),
        *surface_effects(readings),
    ]
    factor = np.ones(count)
    components: dict[str, FloatArray] = {}
    for effect in effects:
        factor /= 1 + effect.size * effect.by_one
        if effect.independent and effect.u:
            components[effect.name] = np.abs(effect.by_one) * effect.u
    return Applied(factor=factor, components=components, shared=tuple(_shared(effects)))


def _shared(effects: Iterable[Effect]) -> Iterable[SharedError]:
    for effect in effects:
        if effect.u and not effect.independent:
            yield SharedError(
                effect.name,
                effect.by_one * effect.u,
                np.zeros(effect.by_one.size, dtype=np.int64),
                np.asarray(effect.theta_i_deg) * effect.u,
                np.asarray(effect.theta_r_deg) * effect.u,
                np.asarray(effect.dphi_deg) * effect.u,
            )
