"""Evaluation of what was measured: a calibration with its quantities, notes and pixel maps."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime

import numpy as np

from acquisition.calibration import checks
from acquisition.calibration.frame_statistics import table_of
from acquisition.calibration.procedure import Measured
from acquisition.results.versions import versions_of
from analysis.calibration.camera_fit import CameraFit, fit_camera
from analysis.calibration.level_series import Estimate
from analysis.calibration.pixel_maps import (
    DarkMaps,
    FlatMaps,
    dark_maps,
    dsnu,
    flat_maps,
    made_linear,
    prnu,
)
from instrument.calibration.camera_calibration import CameraCalibration
from instrument.calibration.quantity import Quantity
from instrument.config.rig import Rig
from instrument.devices import CHANGING_SETTINGS, Camera
from instrument.geometry import BoolArray, FloatArray

_NOTABLE = 0.05  # of a rig file's number: less is within what cameras of one kind differ by
_COVERAGE = 3.0
_BAD_FIT = 4.0  # chi² a point, of the response: something else than light moves the counts


def calibration_of(
    measured: Measured, rig: Rig, camera: Camera, now: datetime
) -> CameraCalibration:
    """Return the calibration. Raises `NotDetermined` for unusable frames."""
    fit = fit_camera(measured.lit, measured.dark, float(rig.camera.max_dn))
    checks.require_no_lamp_in_darks(fit, rig)
    checks.require_steady(fit)
    dark = dark_maps(measured.short_dark, measured.long_dark)
    at_flat = dark.offset_dn + dark.current_dn_per_s * measured.flat.exposure_s
    flat = flat_maps(measured.flat, at_flat, measured.patch.lit, dark.hot, fit.response)
    quantities = dict(_quantities(measured, fit, dark, flat))
    response = fit.response
    own = {k: v for k, v in camera.settings().items() if k not in CHANGING_SETTINGS}
    return CameraCalibration(
        camera=camera.identity(),
        settings=own,
        rig=rig.name,
        date_utc=now.isoformat(timespec="seconds"),
        program=f"gonio {versions_of('gonio')['gonio']}",
        quantities=quantities,
        curve=response.curve,
        black_dn=response.black_dn,
        max_dn=response.max_dn,
        low_dn=response.low_dn,
        high_dn=response.high_dn,
        u_light_relative=response.u_light_relative,
        notes=tuple(_notes(fit, rig)),
        arrays=_arrays(measured, dark, flat),
    )


def _arrays(measured: Measured, dark: DarkMaps, flat: FlatMaps) -> dict[str, FloatArray]:
    maps = {
        "dark_offset_dn": dark.offset_dn,
        "u_dark_offset_dn": dark.u_offset_dn,
        "dark_current_dn_per_s": dark.current_dn_per_s,
        "u_dark_current_dn_per_s": dark.u_current_dn_per_s,
        "hot": dark.hot,
        "response": flat.response,
        "u_response": flat.u_response,
        "measured": flat.measured,
        "deviant": flat.deviant,
        "lit": table_of(measured.lit),
        "dark": table_of(measured.dark),
    }
    return {name: np.asarray(values) for name, values in maps.items()}


def _quantities(
    measured: Measured, fit: CameraFit, dark: DarkMaps, flat: FlatMaps
) -> Iterator[tuple[str, Quantity]]:
    """Yield each quantity with its key, in the order of the table."""
    transfer, response = fit.transfer, fit.response
    electrons = (
        ("dark_noise_electrons", "sigma_d", "dark noise", "e-", transfer.dark_noise_electrons),
        ("dark_current_electrons_per_s", "mu_I", "dark current", "e-/s",
         transfer.dark_current_electrons_per_s),
        ("saturation_electrons", "mu_e.sat", "saturation capacity", "e-",
         transfer.saturation_electrons),
        ("full_well_electrons", "", "full well", "e-",
         transfer.full_well_electrons),
        ("dark_dn", "mu_y.dark", "dark level", "DN", transfer.dark_dn),
    )  # fmt: skip
    yield "gain_dn_per_electron", quantity(transfer.gain_dn_per_electron, "DN/e-", "K", "gain")
    for key, symbol, name, unit, estimate in electrons:
        yield key, quantity(estimate, unit, symbol, name)
    for key, symbol, value in (
        ("linearity_error_min_percent", "LE min", fit.linearity.least_percent),
        ("linearity_error_max_percent", "LE max", fit.linearity.most_percent),
    ):
        yield key, Quantity(value=value, u=None, unit="%", symbol=symbol, name="linearity error")
    bend = None
    if not response.curve.is_video:
        bend = Estimate(100 * response.nonlinearity(), 200 * response.u_light_relative)
    yield "nonlinearity_percent", quantity(bend, "%", "", "non-linearity")
    used = flat.measured & ~flat.deviant
    yield from _uniformity(measured, fit, used)
    for key, name, mask in (
        ("hot_pixels", "hot pixels", dark.hot),
        ("deviant_pixels", "deviant pixels", flat.deviant),
    ):
        count = float(np.count_nonzero(mask))
        yield key, Quantity(value=count, u=None, unit="", symbol="", name=name)
    yield (
        "flicker_percent",
        Quantity(value=100 * fit.flicker, u=None, unit="%", symbol="", name="flicker of lamp"),
    )
    yield (
        "black_wander_dn",
        Quantity(
            value=fit.black_wander_dn,
            u=None,
            unit="DN",
            symbol="",
            name="wander of black",
        ),
    )


def _uniformity(
    measured: Measured, fit: CameraFit, used: BoolArray
) -> Iterator[tuple[str, Quantity]]:
    lit, dark = (made_linear(s, fit.response) for s in (measured.flat, measured.short_dark))
    response = prnu(lit, dark, used)
    percent = Estimate(100 * response.value, 100 * response.u)
    yield "prnu_percent", quantity(percent, "%", "PRNU1288", "spread of responses")
    offset = None
    if not fit.response.curve.is_video:
        offset = dsnu(dark, used, fit.transfer.gain_dn_per_electron.value)
    yield "dsnu_electrons", quantity(offset, "e-", "DSNU1288", "spread of darks")


def quantity(estimate: Estimate | None, unit: str, symbol: str, name: str) -> Quantity:
    """Return an estimate, or what was not determined, as a quantity."""
    value, u = (None, None) if estimate is None else map(float, estimate)
    return Quantity(value=value, u=u, unit=unit, symbol=symbol, name=name)


def rig_file_values(rig: Rig) -> dict[str, float]:
    """Return what the rig file states, by the key of the quantity."""
    camera = rig.camera
    return {
        "gain_dn_per_electron": 1 / camera.electrons_per_dn,
        "dark_noise_electrons": camera.read_noise_electrons,
        "dark_current_electrons_per_s": camera.dark_current_electrons_per_s,
        "full_well_electrons": camera.full_well_electrons,
        "dark_dn": camera.black_level_dn,
        "flicker_percent": 100 * rig.lamp.u_flicker,
        "black_wander_dn": camera.u_black_level_dn,
    }


def _notes(fit: CameraFit, rig: Rig) -> Iterator[str]:
    """Yield findings that a person should act on."""
    transfer, response = fit.transfer, fit.response
    if response.curve.is_video:
        yield (
            f"the camera's response is a {response.curve.name}: switch it off in the camera if it "
            "can be; until then its counts are not proportional to light, and dark noise, dark "
            "current and DSNU cannot be told behind it"
        )
    if response.chi2_per_point > _BAD_FIT:
        yield (
            f"the levels scatter about the response more than noise and flicker explain (chi² a "
            f"point {response.chi2_per_point:.3g}): the u are enlarged; is the lamp steady?"
        )
    if transfer.dark_noise_is_rounding and not response.curve.is_video:
        yield (
            "the dark noise is less than rounding to counts lets see (variance below 0.24 DN²): it "
            "is given as the middle of an interval from 0; a higher gain would show it"
        )
    if transfer.full_well_electrons is None:
        yield "the camera was not driven to saturation: no saturation capacity, no full well"
    yield from _contradictions(transfer.gain_dn_per_electron, rig)


def _contradictions(gain: Estimate, rig: Rig) -> Iterator[str]:
    stated = rig_file_values(rig)["gain_dn_per_electron"]
    if abs(gain.value / stated - 1) > max(_NOTABLE, _COVERAGE * gain.u / gain.value):
        camera = rig.camera
        right = (camera.max_dn - camera.black_level_dn) / gain.value
        yield (
            f"the rig file's full_well_electrons {camera.full_well_electrons:g} does not fit the "
            f"measured gain: {right:.4g} does (the well that full scale corresponds to)"
        )
