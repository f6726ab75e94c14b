"""Conventions of other programs' tables that their user names: they are never guessed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analysis.data.measurements import Measurements
from instrument.errors import InputError


def without_cosine(m: Measurements) -> Measurements:
    """Return the BRDF, and its u, of values that are the BRDF times cos(theta_r).

    Raises `InputError` for a value at theta_r = 90 degrees, where the product is 0.
    """
    grazing = np.abs(m.theta_r_deg) >= 90
    if np.any(grazing):
        raise InputError(
            f"--cosine-corrected: {int(np.sum(grazing))} of {m.size} values stand at theta_r = 90 "
            "degrees, where BRDF times cos(theta_r) is 0; allowed: below; remove them, or leave "
            "out oblique points: --max-theta-deg 89"
        )
    cosine = np.cos(m.geometry.theta_r)
    u_random = None if m.u_random is None else m.u_random / cosine
    return replace(m, brdf=m.brdf / cosine, u_random=u_random)


def from_mirror_azimuth(m: Measurements) -> Measurements:
    """Return the measurements with dphi from the lamp's side, of azimuths from the mirror side."""
    return replace(m, dphi_deg=np.mod(m.dphi_deg + 180.0, 360.0))
