"""Calibration of a camera: its properties with u, response curve and pixel maps.

Counts of a pixel are made linear by `linear_counts_dn`; the maps are for those who correct pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from instrument.calibration.quantity import Quantity
from instrument.calibration.response_curve import ResponseCurve
from instrument.calibration.same_device import (
    LONGEST_AGE_DAYS,
    require_recent,
    require_same_camera,
)
from instrument.errors import InputError
from instrument.geometry import FloatArray
from instrument.text.quoting import shown

MAPS = (
    "dark_offset_dn", "u_dark_offset_dn", "dark_current_dn_per_s", "u_dark_current_dn_per_s",
    "hot", "response", "u_response", "measured", "deviant",
)  # fmt: skip
"""Pixel maps, each (rows, columns): see `analysis.calibration.pixel_maps`."""
LEVEL_COLUMNS = ("exposure_s", "mean_dn", "variance_dn2", "scatter_dn2", "frames", "age_s")
"""Columns of the tables `lit` and `dark`: what was measured, to be evaluated again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraCalibration:
    """Properties of one camera with one set of settings, at one date.

    camera: identity as the device gives it. settings: those that it had. date_utc: in ISO 8601.
    quantities: by their key. black_dn, max_dn: counts that are 0 and 1 to the curve. low_dn,
    high_dn: counts between which it was measured. u_light_relative: of light from counts, beside
    the scale. arrays: pixel maps, and the tables `lit` and `dark`. sha256: of all the rest, empty
    before it is written.
    """

    camera: str
    settings: dict[str, str]
    rig: str
    date_utc: str
    program: str
    quantities: dict[str, Quantity]
    curve: ResponseCurve
    black_dn: float
    max_dn: float
    low_dn: float
    high_dn: float
    u_light_relative: float
    notes: tuple[str, ...]
    arrays: dict[str, FloatArray]
    sha256: str = ""

    def linear_counts_dn(self, counts_dn: FloatArray) -> FloatArray:
        """Return counts of any shape, in DN, on the scale that is linear in light.

        Black and the largest count stay where they are.
        """
        span = self.max_dn - self.black_dn
        return self.black_dn + span * self.curve.light((counts_dn - self.black_dn) / span)

    def require_camera(self, name: str, camera: str, settings: dict[str, str]) -> None:
        """Raise `InputError` if the file `name` is of another camera, or of other settings.

        A setting counts where both state it: exposure and the like are in neither.
        """
        require_same_camera(name, "camera", self.camera, camera)
        for key, own in self.settings.items():
            if settings.get(key, own) != own:
                raise InputError(
                    f"{name}: was made with {key} {shown(own)}, but the camera has "
                    f"{shown(settings[key])}: set it back, or calibrate again"
                )

    def require_date(
        self, name: str, now: datetime, longest_days: float = LONGEST_AGE_DAYS
    ) -> None:
        """Raise `InputError` if the calibration in the file `name` is too old, or of the future."""
        require_recent(name, self.date_utc, now, longest_days)
