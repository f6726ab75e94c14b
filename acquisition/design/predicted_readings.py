"""Readings that a plan will give for a sample of known reflectance, without noise, with their u.

Photon and read noise, rounding and darks follow from the rig, and so does the lamp's irradiance of
a sample that stands off the axis. How strong and how fine the sample's texture is, the protocol's
`simulated_sample` says; without one it is taken as usual.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from acquisition.measure.placement import Placement
from acquisition.measure.radiometry import FEW_PIXELS, LEAVES_FRAME, photon_transfer
from acquisition.measure.rounding import rounding_u_dn
from acquisition.measure.stray_light import white_dn
from acquisition.measure.white_tile import standard
from acquisition.measure.window import Window, window_at
from acquisition.plan.exposure_ladder import longest_exposure_s
from acquisition.plan.plan import Plan, Step
from instrument.config.load import Loaded
from instrument.geometry import Brdf, Geometry
from instrument.pinhole import Pinhole
from instrument.record.reading import Reading

DARK = "no signal predicted"
_LEAST_FACTOR = 1e-6  # of white, below which a sample is dark
_MOTTLING, _MOTTLING_MM = 0.02, 2.0  # usual texture (assumed), as in the protocols of configs/


@dataclass(frozen=True)
class PredictedReadings:
    """Readings of the plan of a loaded protocol, for a sample of this BRDF (in 1/sr)."""

    loaded: Loaded
    brdf: Brdf

    def of(self, plan: Plan) -> list[Reading]:
        """Return one reading for each step of the plan."""
        return list(self._readings(plan))

    def _readings(self, plan: Plan) -> Iterator[Reading]:
        steps = plan.steps
        theta_i, dphi, theta_r = np.array([step.pose for step in steps]).T
        sample = self.brdf(Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi))
        tile = self.loaded.protocol.references.white_tile
        on_tile = np.array([step.kind == "tile" for step in steps])
        factor = np.pi * sample
        if tile is not None and on_tile.any():
            factor[on_tile] = standard(tile, theta_i[on_tile], dphi[on_tile]).beta
        for step, white_part in zip(steps, factor.tolist(), strict=True):
            yield self._reading(step, white_part)

    @cached_property
    def _pinhole(self) -> Pinhole:
        return Pinhole.of(self.loaded.rig)

    def _reading(self, step: Step, factor: float) -> Reading:
        """Reading of a step at which the surface has this radiance factor."""
        rig, protocol, pose = self.loaded.rig, self.loaded.protocol, step.pose
        camera = rig.camera
        patch = protocol.window
        window = window_at(pose.theta_r, self._pinhole, patch.width_mm, patch.height_mm)
        rate_dn = white_dn(rig, pose.theta_i, 1.0) * factor
        full_dn = camera.full_well_electrons / camera.electrons_per_dn
        limit_s = protocol.exposure_target * full_dn / max(rate_dn, 1e-12)
        exposure_s = longest_exposure_s(limit_s, camera)
        signal_dn = rate_dn * exposure_s
        level_dn = np.array([camera.black_level_dn + signal_dn, camera.black_level_dn])
        bright, dark = photon_transfer(level_dn, camera).tolist()
        squares = float(np.sum(window.weights**2))
        time_s = step.start_s + step.duration_s
        return Reading(
            step=step.index,
            kind=step.kind,
            surface=step.surface,
            theta_i_deg=pose.theta_i,
            dphi_deg=pose.dphi,
            theta_r_deg=pose.theta_r,
            lamp_setting=step.lamp_setting,
            block=step.block,
            signal_dn=signal_dn,
            u_noise_dn=float(np.sqrt(squares * (bright + 1 / 12) / step.frames)),
            u_quantisation_dn=rounding_u_dn(bright),
            u_dark_dn=float(np.sqrt(squares * (dark + 1 / 12) / protocol.dark_frames)),
            u_placement_dn=signal_dn * self._u_placement(step),
            u_texture_dn=signal_dn * self._u_texture(step),
            exposure_s=exposure_s,
            frames=step.frames,
            window_pixels=window.pixels,
            saturated_pixels=0,
            peak_dn=camera.black_level_dn + signal_dn,
            time_s=time_s,
            free_s=time_s,
            time_utc="",
            flags="; ".join(self._flags(window, factor)),
        )

    def _flags(self, window: Window, factor: float) -> Iterator[str]:
        if not window.inside_frame:
            yield LEAVES_FRAME
        if window.pixels < self.loaded.protocol.window.min_pixels:
            yield FEW_PIXELS
        if factor < _LEAST_FACTOR:
            yield DARK

    def _u_placement(self, step: Step) -> float:
        """Relative change, signed, for a sample that stands closer to the camera by one u.

        The lamp irradiates it from another distance, and the window then shows a patch that is
        nearer to the lamp, or farther, by the height times tan(theta_r).
        """
        rig, pose = self.loaded.rig, step.pose
        whole = Placement(rig.u_placement_mm, pose.theta_i, rig.lamp_distance_mm).u_irradiance
        theta_i, theta_r, dphi = np.radians([pose.theta_i, pose.theta_r, pose.dphi])
        along_mm = rig.u_placement_mm * float(np.tan(theta_r) * np.cos(dphi))
        return whole + 3 * float(np.sin(theta_i)) * along_mm / rig.lamp_distance_mm

    def _u_texture(self, step: Step) -> float:
        """Relative second-order effect of a shift of the window over the sample's texture.

        A sample off the axis by u shifts the window by s = u tan(theta_r). The mean over a width W
        then gains one strip at each edge and loses another, which differ by the texture's change
        over s. Of texture of relative strength m in spots of size p, strips of the height H differ
        by about m sqrt(p / H) min(s / p, 1); two edges, and sqrt(3) / 2 as of any second order
        (`acquisition.measure.placement`).
        """
        if step.surface != "sample":
            return 0.0
        given, patch = self.loaded.protocol.simulated_sample, self.loaded.protocol.window
        strength, size_mm = _MOTTLING, _MOTTLING_MM
        if given is not None:
            strength, size_mm = given.mottling, given.mottling_size_mm
        shift_mm = abs(
            self.loaded.rig.u_placement_mm * float(np.tan(np.radians(step.pose.theta_r)))
        )
        strip = strength * np.sqrt(min(size_mm / patch.height_mm, 1.0)) * min(shift_mm / size_mm, 1)
        return float(np.sqrt(6) / 2 * shift_mm / patch.width_mm * strip)
