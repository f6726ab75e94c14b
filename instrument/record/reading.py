"""What one row of the run record is: a measured geometry, a drift check at a resume, a picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from instrument.devices import Surface

Kind = Literal["point", "tile", "drift"]


@dataclass(frozen=True, slots=True)
class Reading:
    """One measured geometry, in counts: the mean of the window, its uncertainties, its flags.

    `step` is its number in the plan. Angles in degrees, theta_r signed. `signal_dn` is the
    area-weighted mean of the window over all frames less the dark, cos^4 divided out; the u are
    standard uncertainties of it: `u_noise_dn` of photons and read-out, `u_quantisation_dn` of
    rounding the frames to whole counts, `u_dark_dn` of the dark (the same for all readings
    of one exposure), `u_placement_dn` of how well the sample stands on the axis (signed:
    one placement shifts all its readings together) and `u_texture_dn` of what that leaves out.
    `lamp_setting` numbers the places of the lamp, `block` the times it was set by hand.
    `time_s` is the scan's time at the end of its frames, without the times that the scan stood
    still; at `free_s` the rig was free to go on, its dark taken.
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


@dataclass(frozen=True, slots=True)
class Check:
    """The drift reference, measured again when a scan goes on; `reading.step` is what it repeats.

    `before_step`: the first step of the plan that comes after it. `expected`: the counts per
    second that earlier checks foretell, `u_expected` the standard uncertainty of the difference.
    `jumped`: the lamp is not what it was, so its level is counted from this check on.
    """

    before_step: int
    expected: float
    u_expected: float
    jumped: bool
    reading: Reading


@dataclass(frozen=True, slots=True)
class Preview:
    """A small picture for the report with the window's outline, (N, 2) as (column, row)."""

    step: int
    caption: str
    png: bytes
    polygon: list[list[float]]
