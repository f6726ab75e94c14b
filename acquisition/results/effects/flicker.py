"""Flicker of the lamp in the noise of each reading, as all readings of the scan tell it.

During a scan a reading has the flicker that those before it have shown: the first have none, and
those that follow the bound of what a few tell. With the noise of their pixels alone the first would
count for up to 25 times what they are worth, and a fit would follow them. Where frames surely
scatter more than the scan explains, what was found during the scan stays.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace

from acquisition.interlocks.frame_scatter import (
    RECENT,
    Scatter,
    flicker_share,
    scatter_of,
    surely_more,
)
from instrument.config.rig import Rig
from instrument.record.reading import Check, Reading


def with_flicker(
    readings: Sequence[Reading], checks: Sequence[Check], rig: Rig
) -> tuple[list[Reading], list[Check]]:
    """Return readings and checks, whose noise has the flicker that all readings show.

    Those of a steady lamp, and of a record that does not keep the scatter, stay as they are.
    """
    kept = sorted((one for one in readings if one.u_pixel_dn > 0), key=lambda one: one.time_s)
    scatters = [scatter_of(one, rig) for one in kept]
    share = flicker_share(scatters)
    if not share:
        return list(readings), list(checks)
    flicker = _Flicker(share, [one.time_s for one in kept], scatters, rig)
    told = [flicker.told(one) for one in readings]
    return told, [replace(c, reading=flicker.told(c.reading)) for c in checks]


@dataclass(frozen=True, slots=True)
class _Flicker:
    """Share, 0 to 1, of what the rig file allows; times in s and scatter of the scan's readings."""

    share: float
    times_s: list[float]
    scatters: list[Scatter]
    rig: Rig

    def told(self, reading: Reading) -> Reading:
        """Return the reading with this flicker in its noise."""
        if not reading.u_pixel_dn > 0:
            return reading
        own, frames = scatter_of(reading, self.rig), max(reading.frames, 1)
        u_noise_dn = math.sqrt(own.explained(self.share).pixel_variance / frames)
        if self._stays(reading, own):
            u_noise_dn = max(u_noise_dn, reading.u_noise_dn)
        return replace(reading, u_noise_dn=u_noise_dn)

    def _stays(self, reading: Reading, own: Scatter) -> bool:
        """Return whether the noise found during the scan has another cause, or a known one."""
        allowed = own.explained(1.0).pixel_variance / max(reading.frames, 1)
        if reading.u_noise_dn**2 > allowed:
            return True
        last = bisect_right(self.times_s, reading.time_s)
        return surely_more(own, self.scatters[max(last - RECENT, 0) : last], self.share)
