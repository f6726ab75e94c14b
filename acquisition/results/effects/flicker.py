"""Flicker of the lamp in the noise of each reading, as all readings of the scan tell it.

During a scan a reading has the flicker that those before it have shown, and the first have none.
Their few frames may agree by chance: with the noise of their pixels alone they would count for up
to 25 times what they are worth, and a fit would follow them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from acquisition.interlocks.frame_scatter import flicker_share, scatter_of
from instrument.config.rig import Rig
from instrument.record.reading import Check, Reading


def with_flicker(
    readings: Sequence[Reading], checks: Sequence[Check], rig: Rig
) -> tuple[list[Reading], list[Check]]:
    """Return readings and checks, whose noise has at least the flicker that all readings show.

    Those of a steady lamp, and of a record that does not keep the scatter, stay as they are.
    """
    share = flicker_share(scatter_of(one, rig) for one in readings if one.u_pixel_dn > 0)
    if not share:
        return list(readings), list(checks)
    raised = [_raised(one, share, rig) for one in readings]
    return raised, [replace(c, reading=_raised(c.reading, share, rig)) for c in checks]


def _raised(reading: Reading, share: float, rig: Rig) -> Reading:
    if not reading.u_pixel_dn > 0:
        return reading
    variance = scatter_of(reading, rig).explained(share).pixel_variance / max(reading.frames, 1)
    return replace(reading, u_noise_dn=max(reading.u_noise_dn, math.sqrt(variance)))
