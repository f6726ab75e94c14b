"""Section `uncertainty:` of a rig file: what no command of the program measures.

All are absent unless given. Those with `u_` are standard uncertainties (k = 1); the others are
sizes that the values are corrected for, in one direction only. `acquisition.results.effects` says
how each depends on the geometry.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from instrument.config.section import NotNegative, Section

_Share = Annotated[float, Field(ge=0, le=0.5)]
_Degrees = Annotated[float, Field(ge=0, le=10)]


class RigLines(Section):
    """Sizes of effects of a rig, and their standard uncertainties.

    `u_polarisation_lamp`, `u_polarisation_camera`: relative excess of light, or of response, that
    vibrates across the plane in which the device swings. `u_linearity`: relative excess of the
    counts of a faint light over those of full scale. `u_dark_drift_electrons_per_s_per_h`: change
    of the dark current after its dark frames. `u_pixel_response`: relative, of a single pixel.

    `vignetting`: loss of light, beyond cos^4, at half the picture's diagonal; it grows with the
    square of the distance from the middle. `stray_light`: share of the light that the lens
    scatters; half of it falls within sqrt(3) `stray_light_width` times the picture's width.
    `background_reflectance`: of what surrounds the sample in the picture. `wall_light`: light of
    the lamp that comes back from the surroundings, relative to the lamp's. `tile_aged`: relative
    loss of the white tile since its certificate.

    `u_tilt_deg`, `u_tilt_across_deg`: lean of the sample's normal in and across the plane in which
    the camera swings; `u_tile_tilt_deg`, `u_tile_tilt_across_deg`: of the white tile's.
    `u_zero_theta_i_deg`, `u_zero_dphi_deg`, `u_zero_theta_r_deg`: of each axis, at all angles.
    """

    u_polarisation_lamp: _Share = 0.0
    u_polarisation_camera: _Share = 0.0
    u_linearity: _Share = 0.0
    u_dark_drift_electrons_per_s_per_h: NotNegative = 0.0
    u_pixel_response: _Share = 0.0
    vignetting: _Share = 0.0
    u_vignetting: _Share = 0.0
    stray_light: _Share = 0.0
    u_stray_light: _Share = 0.0
    stray_light_width: Annotated[float, Field(ge=0.02, le=2)] = 0.15
    background_reflectance: Annotated[float, Field(ge=0, le=1)] = 0.04
    wall_light: _Share = 0.0
    u_wall_light: _Share = 0.0
    tile_aged: _Share = 0.0
    u_tile_aged: _Share = 0.0
    u_tilt_deg: _Degrees = 0.0
    u_tilt_across_deg: _Degrees = 0.0
    u_tile_tilt_deg: _Degrees = 0.0
    u_tile_tilt_across_deg: _Degrees = 0.0
    u_zero_theta_i_deg: _Degrees = 0.0
    u_zero_dphi_deg: _Degrees = 0.0
    u_zero_theta_r_deg: _Degrees = 0.0
