"""Window that follows the plate which carries the sample, where markers on it are seen."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

from acquisition.measure.plate.markers import PlateShift, plate_shift
from acquisition.measure.window import Window, new_window, window_at
from instrument.config.protocol import Protocol
from instrument.devices import Surface
from instrument.pinhole import Pinhole

log = logging.getLogger(__name__)


class PlateFollower:
    """Windows of a scan's readings.

    They are at the rotation axis, except for a sample whose markers are seen. `note` is called
    with the shift at the first picture of each placing of the sample, and where none is seen.
    """

    def __init__(self, pinhole: Pinhole, protocol: Protocol, note: Callable[[str], None]) -> None:
        self._pinhole, self._patch, self._markers = pinhole, protocol.window, protocol.markers
        self._note = note
        self._said: set[str] = set()
        self._turn_deg = 0.0  # as last seen

    def window(self, image: NDArray[Any], theta_r_deg: float, surface: Surface) -> Window:
        """Return the window of a picture (rows, columns) in counts, seen from theta_r (signed)."""
        size = self._patch.width_mm, self._patch.height_mm
        if self._markers is None or surface != "sample":
            self._said.discard("seen")
            self._turn_deg = 0.0
            return window_at(theta_r_deg, self._pinhole, *size)
        shift = plate_shift(image, theta_r_deg, self._pinhole, self._markers, self._turn_deg)
        self._say(shift, len(self._markers.centres_mm), theta_r_deg)
        if shift is None:
            return window_at(theta_r_deg, self._pinhole, *size)
        self._turn_deg = shift.turn_deg
        return new_window(theta_r_deg, self._pinhole, *size, (shift.x_mm, shift.y_mm))

    def _say(self, shift: PlateShift | None, total: int, theta_r_deg: float) -> None:
        """Record the first picture with markers of a placing, and the first one without."""
        kind = "missing" if shift is None else "seen"
        if kind in self._said:
            return
        self._said.add(kind)
        if shift is None:
            text = (
                f"markers: none of {total} seen at theta_r {theta_r_deg:g} deg, nor perhaps in "
                "other pictures: the window is at the rotation axis there. If none is ever seen, "
                "look at size_mm and centres_mm in the protocol, and at a picture (gonio grab)"
            )
            log.warning(text)
        else:
            text = (
                f"markers: {shift.markers} of {total} seen at theta_r {theta_r_deg:g} deg: the "
                f"plate is shifted by x {shift.x_mm:+.2f} mm, y {shift.y_mm:+.2f} mm, turned by "
                f"{shift.turn_deg:+.2f} deg; the window follows it"
            )
        self._note(text)
