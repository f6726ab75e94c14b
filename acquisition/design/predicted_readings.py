"""Readings that a plan will give for a sample of known reflectance, without noise, with their u.

Photon and read noise, rounding and darks follow from the rig, and so does the lamp's irradiance of
a sample that stands off the axis. How strong and how fine the sample's texture is, the protocol's
`simulated_sample` says; without one it is taken as usual.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from acquisition.measure.placement import Placement
from acquisition.measure.radiometry import FEW_PIXELS, LEAVES_FRAME, photon_transfer
from acquisition.measure.rounding import rounding_u_dn
from acquisition.measure.stray_light import white_dn
from acquisition.measure.white_tile import standard
from acquisition.measure.window import Window, window_at
from acquisition.plan.exposure_ladder import longest_exposures_s
from acquisition.plan.plan import Plan
from instrument.config.load import Loaded
from instrument.geometry import BoolArray, Brdf, FloatArray, Geometry, IntArray
from instrument.pinhole import Pinhole
from instrument.record.reading import Reading

DARK = "no signal predicted"
_LEAST_FACTOR = 1e-6  # of white, below which a sample is dark
_MOTTLING, _MOTTLING_MM = 0.02, 2.0  # usual texture (assumed), as in the protocols of configs/


@dataclass(frozen=True)
class PredictedReadings:
    """Readings of a loaded protocol's plan; what does not depend on the sample is found once."""

    loaded: Loaded
    plan: Plan

    def of(self, brdf: Brdf) -> list[Reading]:
        """Return one reading for each of the N steps of the plan.

        brdf: the sample's, which returns (N,) in 1/sr.
        """
        protocol, camera = self.loaded.protocol, self.loaded.rig.camera
        factor = self._factor(brdf)
        rate_dn = self._white_dn * factor
        full_dn = camera.full_well_electrons / camera.electrons_per_dn
        limit_s = protocol.exposure_target * full_dn / np.maximum(rate_dn, 1e-12)
        exposure_s = longest_exposures_s(limit_s, camera)
        signal_dn = rate_dn * exposure_s
        bright = photon_transfer(camera.black_level_dn + signal_dn, camera)
        dark = photon_transfer(np.array(camera.black_level_dn), camera)
        columns = {
            "signal_dn": signal_dn,
            "u_noise_dn": np.sqrt(self._squares * (bright + 1 / 12) / self._frames),
            "u_quantisation_dn": np.array([rounding_u_dn(own) for own in bright.tolist()]),
            "u_dark_dn": np.sqrt(self._squares * (dark + 1 / 12) / protocol.dark_frames),
            "u_placement_dn": signal_dn * self._u_placement,
            "u_texture_dn": np.abs(signal_dn) * self._u_texture,  # a model may be negative there
            "exposure_s": exposure_s,
            "peak_dn": camera.black_level_dn + signal_dn,
        }
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        least = protocol.window.min_pixels
        each = zip(self._known, self._windows, factor.tolist(), rows, strict=True)
        return [
            Reading(
                **known,
                **dict(zip(columns, row, strict=True)),
                flags="; ".join(_flags(window, least, white_part)),
            )
            for known, window, white_part, row in each
        ]

    def _factor(self, brdf: Brdf) -> FloatArray:
        """Radiance factor (N,) of the surface at each step."""
        on_tile, standards = self._on_tile
        factor = np.pi * brdf(self._geometry)
        factor[on_tile] = standards
        return np.asarray(factor)

    @cached_property
    def _geometry(self) -> Geometry:
        theta_i, dphi, theta_r = self._angles
        return Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)

    @cached_property
    def _angles(self) -> FloatArray:
        """theta_i, dphi and theta_r (3, N) in degrees."""
        return np.array([step.pose for step in self.plan.steps]).T

    @cached_property
    def _on_tile(self) -> tuple[BoolArray, FloatArray]:
        """Mask (N,) of the readings of the white tile, and its factor at each of them, (M,)."""
        tile, (theta_i, dphi, _) = self.loaded.protocol.references.white_tile, self._angles
        mask = np.array([step.kind == "tile" for step in self.plan.steps])
        if tile is None or not mask.any():
            return np.zeros(mask.size, dtype=bool), np.zeros(0)
        return mask, standard(tile, theta_i[mask], dphi[mask]).beta

    @cached_property
    def _windows(self) -> list[Window]:
        patch, pinhole = self.loaded.protocol.window, Pinhole.of(self.loaded.rig)
        views: list[float] = self._angles[2].tolist()
        return [window_at(view, pinhole, patch.width_mm, patch.height_mm) for view in views]

    @cached_property
    def _squares(self) -> FloatArray:
        """Sum (N,) of the squared weights of each window."""
        return np.array([float(np.sum(window.weights**2)) for window in self._windows])

    @cached_property
    def _frames(self) -> IntArray:
        return np.array([step.frames for step in self.plan.steps], dtype=np.int64)

    @cached_property
    def _white_dn(self) -> FloatArray:
        """Counts (N,) of white in DN/s."""
        rig = self.loaded.rig
        return np.array([white_dn(rig, step.pose.theta_i, 1.0) for step in self.plan.steps])

    @cached_property
    def _known(self) -> list[dict[str, Any]]:
        """Entries of each reading that do not depend on the sample."""
        return [
            {
                "step": step.index,
                "kind": step.kind,
                "surface": step.surface,
                "theta_i_deg": step.pose.theta_i,
                "dphi_deg": step.pose.dphi,
                "theta_r_deg": step.pose.theta_r,
                "lamp_setting": step.lamp_setting,
                "block": step.block,
                "frames": step.frames,
                "window_pixels": window.pixels,
                "saturated_pixels": 0,
                "time_s": step.start_s + step.duration_s,
                "free_s": step.start_s + step.duration_s,
                "time_utc": "",
            }
            for step, window in zip(self.plan.steps, self._windows, strict=True)
        ]

    @cached_property
    def _u_placement(self) -> FloatArray:
        """Relative change (N,), signed, for a sample that stands closer to the camera by one u.

        The lamp irradiates it from another distance, and the window then shows a patch that is
        nearer to the lamp, or farther, by the height times tan(theta_r).
        """
        rig = self.loaded.rig
        whole = [
            Placement(rig.u_placement_mm, step.pose.theta_i, rig.lamp_distance_mm).u_irradiance
            for step in self.plan.steps
        ]
        theta_i, dphi, theta_r = np.radians(self._angles)
        along_mm = rig.u_placement_mm * np.tan(theta_r) * np.cos(dphi)
        return np.asarray(whole + 3 * np.sin(theta_i) * along_mm / rig.lamp_distance_mm)

    @cached_property
    def _u_texture(self) -> FloatArray:
        """Relative second-order effect (N,) of a shift of the window over the sample's texture.

        A sample off the axis by u shifts the window by s = u tan(theta_r). The mean over a width W
        then gains one strip at each edge and loses another, which differ by the texture's change
        over s. Of texture of relative strength m in spots of size p, strips of the height H differ
        by about m sqrt(p / H) min(s / p, 1); two edges, and sqrt(3) / 2 as of any second order
        (`acquisition.measure.placement`).
        """
        given, patch = self.loaded.protocol.simulated_sample, self.loaded.protocol.window
        strength, size_mm = _MOTTLING, _MOTTLING_MM
        if given is not None:
            strength, size_mm = given.mottling, given.mottling_size_mm
        shift_mm = np.abs(self.loaded.rig.u_placement_mm * np.tan(np.radians(self._angles[2])))
        one_spot = strength * np.sqrt(min(size_mm / patch.height_mm, 1.0))
        strip = one_spot * np.minimum(shift_mm / size_mm, 1)
        on_sample = np.array([step.surface == "sample" for step in self.plan.steps])
        return np.where(on_sample, np.sqrt(6) / 2 * shift_mm / patch.width_mm * strip, 0.0)


def _flags(window: Window, min_pixels: float, factor: float) -> Iterator[str]:
    if not window.inside_frame:
        yield LEAVES_FRAME
    if window.pixels < min_pixels:
        yield FEW_PIXELS
    if factor < _LEAST_FACTOR:
        yield DARK
