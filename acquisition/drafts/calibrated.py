"""Values that the calibrations of camera and lamp found, for the keys of a rig file."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from acquisition.calibration.lamp.result import proposed_flicker
from analysis.calibration.level_series import Estimate
from instrument.calibration.camera_calibration import CameraCalibration
from instrument.calibration.camera_file import read_camera_file
from instrument.calibration.lamp_file import read_lamp_file
from instrument.calibration.quantity import Quantity
from instrument.config.camera import CameraConfig
from instrument.errors import InputError

USUAL_WANDER_DN = CameraConfig.model_fields["u_black_level_dn"].default
_LEAST = {"u_black_level_dn": USUAL_WANDER_DN, "dark_current_electrons_per_s": 0.0}
"""Least values. A wander has no u: a smaller one, of a few minutes, would raise false alarms."""
_KEYS = {  # of a rig file: key of the calibration's quantity
    "read_noise_electrons": "dark_noise_electrons",
    "dark_current_electrons_per_s": "dark_current_electrons_per_s",
    "black_level_dn": "dark_dn",
    "u_black_level_dn": "black_wander_dn",
}


@dataclass(frozen=True, slots=True)
class Calibrated:
    """Calibration in a file, and the lines of a rig file that follow from it."""

    path: Path
    found: CameraCalibration

    @classmethod
    def of(cls, path: Path) -> Calibrated:
        """Read a file; raise `InputError` if it is no calibration."""
        try:
            return cls(path, _read(path, path.stat().st_mtime_ns))
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror}): check its name") from None

    def require_fit(self, name: str, width_px: int, height_px: int) -> None:
        """Raise `InputError` if it is of a camera with pictures of another size."""
        rows, columns = self.found.arrays["response"].shape
        if (columns, rows) != (width_px, height_px):
            raise InputError(
                f"{name}: is of a camera with {columns} x {rows} pixels; allowed: {width_px} x "
                f"{height_px}, as answered before"
            )

    def source(self) -> str:
        """Return camera and date of the calibration, for a comment."""
        return f"{self.found.camera}, {self.found.date_utc[:10]}"

    def values(self, max_dn: int) -> dict[str, tuple[float, str]]:
        """Return value and comment by the key of a rig file, for a camera that counts to `max_dn`.

        Quantities that the calibration did not determine are left out.
        """
        values = {}
        for key, name in _KEYS.items():
            quantity = self.found.quantities.get(name)
            if quantity is not None and quantity.value is not None:
                least = _LEAST.get(key, -math.inf)
                above = "" if quantity.value >= least else "the least; "
                value = max(quantity.value, least)
                values[key] = float(f"{value:.5g}"), above + _measured(quantity)
        flicker = self.found.quantities.get("flicker_percent")
        if flicker is not None and flicker.value is not None:
            values["u_flicker"] = _flicker(flicker)
        gain = self.found.quantities.get("gain_dn_per_electron")
        if gain is not None and gain.value and "black_level_dn" in values:
            well = (max_dn - values["black_level_dn"][0]) / gain.value
            comment = f"measured: full scale over the gain of {_value_text(gain)}"
            values["full_well_electrons"] = float(f"{well:.5g}"), comment
        return values


def lamp_flicker(path: Path) -> tuple[float, str]:
    """Return `u_flicker` and its comment from a lamp's calibration; raise `InputError`."""
    flicker = read_lamp_file(path).quantities.get("flicker_percent")
    if flicker is None or flicker.value is None:
        raise InputError(f"{path}: holds no flicker. Calibrate again")
    return _flicker(flicker)


def _flicker(flicker: Quantity) -> tuple[float, str]:
    """Return `u_flicker`, not below what some minutes can tell, and its comment."""
    found = Estimate(0.01 * (flicker.value or 0.0), 0.01 * (flicker.u or 0.0))
    return proposed_flicker(found), f"{_measured(flicker)}, rounded up"


@lru_cache(maxsize=2)
def _read(path: Path, stamp: int) -> CameraCalibration:  # noqa: ARG001 - a new one is read anew
    return read_camera_file(path)


def _measured(quantity: Quantity) -> str:
    return f"measured: {_value_text(quantity)}"


def _value_text(quantity: Quantity) -> str:
    spread = f" ± {quantity.u:.2g}" if quantity.u is not None else ""
    return f"{quantity.value:.5g}{spread} {quantity.unit}".rstrip()
