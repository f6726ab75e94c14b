"""Refusal of a calibration that is not of the device at hand, or too old."""

from __future__ import annotations

from datetime import datetime, timedelta

from instrument.errors import InputError

LONGEST_AGE_DAYS = 365.0
"""Age above which a calibration is outdated: a year, the usual interval of laboratories."""


def require_same_camera(name: str, kind: str, calibrated: str, camera: str) -> None:
    """Raise `InputError` if the calibration in the file `name` is of another camera.

    `kind`: of the calibration, as in `gonio calibrate KIND`.
    """
    if camera != calibrated:
        raise InputError(
            f"{name}: is the calibration of {calibrated!r}, but the camera is "
            f"{camera!r}: calibrate this one (gonio calibrate {kind})"
        )


def require_recent(
    name: str, date_utc: str, now: datetime, longest_days: float = LONGEST_AGE_DAYS
) -> None:
    """Raise `InputError` if the calibration in the file `name` is too old, or of the future."""
    made = datetime.fromisoformat(date_utc)
    if now - made > timedelta(days=longest_days):
        age = f"{(now - made).days} days old; allowed: {longest_days:g}"
        raise InputError(f"{name}: is {age}. Calibrate again")
    if made - now > timedelta(days=1):
        raise InputError(f"{name}: is dated {date_utc}, in the future: check the computer's clock")
