"""Rows of the run record: a measured geometry, a drift check at a resume, a preview."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from instrument.devices import Surface

Kind = Literal["point", "tile", "drift"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """One measured geometry in counts (DN): the mean over the window, its uncertainties, its flags.

    `step` is its number in the plan. Angles in degrees, theta_r signed. `signal_dn` is the
    area-weighted mean over the window and all frames, dark subtracted, divided by cos^4. The u are
    its standard uncertainties: `u_noise_dn` from photon and read-out noise and from what frames
    scatter beyond it (flicker, black level), `u_quantisation_dn` from rounding the frames to whole
    counts, `u_dark_dn` from the dark (shared by all readings of one exposure), `u_placement_dn`
    from the height of the surface above the axis (signed: one placement shifts all its readings
    together; without the part that depends on the reflectance), and `u_texture_dn` from the texture
    at the window's edge, to second order of the placement, and from hot pixels, which are left out,
    and saturated ones. `window_pixels`: the area that counts. `patch_dn`: level of the rig's dark
    patch, dark subtracted, with the u of its noise; the six after it: what would fall into window
    and patch if the lens scattered all light of the picture near by, farther and far, see
    `acquisition.measure.stray_light`. All are 0 without a patch. Stray light is in `signal_dn`.
    `lamp_setting` counts the positions of the lamp, `block` the times that it was set by hand.
    `time_s` is the scan time at the middle of the frames, without interruptions of the scan;
    `free_s` is the time at which the rig could move on, the dark having been taken.
    """

    step: int
    kind: Kind
    surface: Surface
    theta_i_deg: float
    dphi_deg: float
    theta_r_deg: float
    lamp_setting: int
    block: int
    signal_dn: float
    u_noise_dn: float
    u_quantisation_dn: float
    u_dark_dn: float
    u_placement_dn: float
    u_texture_dn: float
    exposure_s: float
    frames: int
    window_pixels: float
    saturated_pixels: int
    peak_dn: float
    time_s: float
    free_s: float
    time_utc: str
    flags: str
    patch_dn: float = 0.0
    u_patch_dn: float = 0.0
    near_window_dn: float = 0.0
    middle_window_dn: float = 0.0
    far_window_dn: float = 0.0
    near_patch_dn: float = 0.0
    middle_patch_dn: float = 0.0
    far_patch_dn: float = 0.0

    @property
    def u_light_dn(self) -> float:
        """Standard uncertainty of the light at this place: of noise, rounding and the dark, in DN.

        Several exposures of a quiet 8-bit sensor have the same rounding: noise alone says little.
        """
        return math.hypot(self.u_noise_dn, self.u_quantisation_dn, self.u_dark_dn)


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """Drift check at a resume, or one that ended the scan.

    `reading.step`: the drift check of the plan that it repeats, or is. `before_step`: the first
    step of the plan after it. `expected`: counts per second that earlier
    checks predict; `u_expected`: standard uncertainty of the difference from it. `jumped`: the
    lamp's level has changed, so its drift is followed anew from this check on.
    """

    before_step: int
    expected: float
    u_expected: float
    jumped: bool
    reading: Reading


@dataclass(frozen=True, slots=True)
class Preview:
    """PNG picture for the report and the window's outline, (N, 2) pixels as (column, row)."""

    step: int
    caption: str
    png: bytes
    polygon: list[list[float]]


class Rows(NamedTuple):
    """Readings, drift checks at resumes, and events (time, kind, text) of a record, in order."""

    readings: Sequence[Reading]
    checks: Sequence[Check]
    events: Sequence[tuple[str, str, str]]
