"""Evaluation of a watched lamp: drift, flicker, uniformity, and proposals for a scan."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from acquisition.calibration.checks import SATURATED
from acquisition.calibration.lamp import checks
from acquisition.calibration.lamp.plan import LampPlan
from acquisition.calibration.lamp.watch import COVERAGE, Watched, is_steady
from acquisition.calibration.result import quantity
from acquisition.measure.hot_pixels import find_hot_pixels
from acquisition.results.versions import versions_of
from acquisition.terminal.console import duration_text
from analysis.calibration.lamp_drift import DriftFit
from analysis.calibration.level_series import Estimate, flicker, flicker_estimate
from analysis.calibration.uniformity import (
    Cells,
    UniformityFit,
    cells_of,
    fit_uniformity,
    irradiance,
)
from instrument.calibration.lamp_file import LampCalibration, LightMap
from instrument.calibration.quantity import Quantity
from instrument.config.rig import Rig
from instrument.devices import CHANGING_SETTINGS, Camera, Lamp
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole, apply_homography

_INSIDE = 0.9  # of the tile's side: its edges are left out
_WANDERS = 4.0  # chi² a reading: the lamp does more between readings than noise and flicker
_MOST_POINTS = 200  # between two drift checks
_DIFFERS = 1.5  # times the rig file's flicker
_LEAST_FLICKER = 3e-4  # what some minutes do not tell from a slow unrest (assumed)


@dataclass(frozen=True, slots=True, kw_only=True)
class LampFit:
    """Fits of a watched lamp; `change`: relative, within the plan's time, from the end on."""

    drift: DriftFit
    uniformity: UniformityFit
    cells: Cells
    flicker: Estimate
    photon_noise: float
    black_wander_dn: float
    change: Estimate
    every_points: int
    point_s: float


def fit_lamp(watched: Watched, plan: LampPlan) -> LampFit:
    """Return the fits. Raises `NotDetermined` for a picture that does not show the tile."""
    readings = watched.readings
    drift = readings.fit()
    cells = _cells(watched, plan)
    checks.require_lit_tile(cells.light, plan.tile_mm)
    _, wander = flicker(readings.lit, readings.dark)
    change = drift.change(float(readings.lit.age_s[-1]), plan.within_s)
    point_s = plan.point_s(watched.picture.exposure_s)
    own_dn = np.sqrt(readings.lit.variance_dn2 / readings.lit.pixels)
    return LampFit(
        drift=drift,
        uniformity=fit_uniformity(cells),
        cells=cells,
        flicker=flicker_estimate(readings.lit, wander, float(readings.dark.mean_dn.min())),
        photon_noise=float(np.mean(own_dn / readings.signal_dn())),
        black_wander_dn=wander,
        change=change,
        every_points=_every_points(change, plan, point_s),
        point_s=point_s,
    )


def _cells(watched: Watched, plan: LampPlan) -> Cells:
    """Return the light over the tile, with cos^4, distance and cosine of the lamp taken out."""
    rig, pinhole = plan.rig, Pinhole.of(plan.rig)
    dark_dn = watched.dark_picture.mean_dn
    rows, columns = np.indices(dark_dn.shape)
    to_plane: FloatArray = np.asarray(np.linalg.inv(pinhole.homography(plan.theta_r_deg)))
    points_mm = apply_homography(to_plane, np.stack([columns, rows], axis=-1).reshape(-1, 2))
    lit_dn = watched.picture.mean_dn
    signal = ((lit_dn - dark_dn) / pinhole.cos4(columns, rows)).ravel()
    light = signal / irradiance(points_mm, plan.theta_i_deg, 0.0, rig.lamp_distance_mm)
    used = ~find_hot_pixels(dark_dn, rig.camera) & (lit_dn < SATURATED * rig.camera.max_dn)
    return cells_of(points_mm, light, used.ravel(), _INSIDE * plan.tile_mm)


def _every_points(change: Estimate, plan: LampPlan, point_s: float) -> int:
    """Return the points of a scan in which the light changes by no more than the limit."""
    most = abs(change.value) + COVERAGE * change.u
    points = plan.within_s * plan.limit / max(most, 1e-12) / point_s
    return int(np.clip(points, 1, _MOST_POINTS))


def lamp_calibration_of(
    watched: Watched, plan: LampPlan, lamp: Lamp, camera: Camera, now: datetime
) -> LampCalibration:
    """Return the calibration. Raises `NotDetermined` for an unusable picture."""
    fit, readings = fit_lamp(watched, plan), watched.readings
    polynomial, cells = fit.uniformity, fit.cells
    own = {k: v for k, v in camera.settings().items() if k not in CHANGING_SETTINGS}
    return LampCalibration(
        lamp=lamp.identity(),
        camera=camera.identity(),
        settings=own,
        rig=plan.rig.name,
        pose_deg={"theta_i": plan.theta_i_deg, "dphi": 0.0, "theta_r": plan.theta_r_deg},
        date_utc=now.isoformat(timespec="seconds"),
        program=f"gonio {versions_of('gonio')['gonio']}",
        steady=is_steady(fit.change, plan),
        quantities=dict(_quantities(fit, plan)),
        light_map=LightMap(
            exponents=tuple((int(i), int(j)) for i, j in polynomial.exponents),
            coefficients=tuple(map(float, polynomial.coefficients)),
            half_mm=polynomial.half_mm,
        ),
        notes=tuple(_notes(fit, plan, float(readings.lit.age_s[-1]))),
        arrays={
            "readings": np.stack(
                [readings.lit.age_s, readings.signal_dn(), readings.u_signal_dn()], axis=1
            ),
            "cells": np.stack([cells.x_mm, cells.y_mm, cells.light, cells.pixels], axis=1),
        },
    )


def _quantities(fit: LampFit, plan: LampPlan) -> Iterator[tuple[str, Quantity]]:
    """Yield each quantity with its key, in the order of the table."""
    drift, warms = fit.drift, fit.drift.tau_s is not None
    missing = _scaled(drift.estimate(1), 100.0) if warms else None
    yield "warm_up_percent", quantity(missing, "%", "", "light missing at the start")
    yield "warm_up_s", quantity(drift.estimate(2) if warms else None, "s", "", "its time constant")
    steady = drift.steady(plan.limit, plan.within_s)
    yield "steady_s", quantity(steady, "s", "", "steady after")
    per_hour = _scaled(drift.estimate(0), 360_000.0)
    yield "drift_percent_per_hour", quantity(per_hour, "%/h", "", "steady drift")
    name = f"change in the next {plan.within_minutes:g} min"
    yield "change_percent", quantity(_scaled(fit.change, 100.0), "%", "", name)
    flickers = _scaled(fit.flicker, 100.0)
    yield "flicker_percent", quantity(flickers, "%", "", "flicker from frame to frame")
    noise = 100 * fit.photon_noise
    yield "photon_noise_percent", _without_u(noise, "%", "noise of a frame's mean, by photons")
    yield "black_wander_dn", _without_u(fit.black_wander_dn, "DN", "wander of black")
    peak = _scaled(fit.uniformity.peak_to_valley(plan.window_mm), 100.0)
    name = f"peak to valley in {plan.window_mm:g} x {plan.window_mm:g} mm"
    yield "peak_to_valley_percent", quantity(peak, "%", "", name)
    residual = 100 * fit.uniformity.residual
    name = f"left by the polynomial, order {fit.uniformity.order}"
    yield "residual_percent", _without_u(residual, "%", name)
    yield "every_points", _without_u(float(fit.every_points), "", "points between drift checks")


def _scaled(estimate: Estimate, factor: float) -> Estimate:
    return Estimate(factor * estimate.value, factor * estimate.u)


def _without_u(value: float, unit: str, name: str) -> Quantity:
    return Quantity(value=value, u=None, unit=unit, symbol="", name=name)


def proposed_flicker(found: Estimate) -> float:
    """Return the `u_flicker` for a rig file: two digits, rounded up, at least `_LEAST_FLICKER`."""
    most = max(found.value + found.u, _LEAST_FLICKER)
    step = 10.0 ** (math.floor(math.log10(most)) - 1)
    return float(f"{math.ceil(most / step - 1e-9) * step:.6g}")


def stated_by_rig(rig: Rig) -> dict[str, float]:
    """Return what the rig file states, by the key of the quantity."""
    return {
        "flicker_percent": 100 * rig.lamp.u_flicker,
        "black_wander_dn": rig.camera.u_black_level_dn,
    }


def _notes(fit: LampFit, plan: LampPlan, end_s: float) -> Iterator[str]:
    """Yield findings that a person should act on."""
    if not is_steady(fit.change, plan):
        yield _not_steady(fit, plan, end_s)
    yield (
        f"proposed for a protocol: drift_check: {{every_points: {fit.every_points}}}: the light "
        f"changes by no more than {plan.limit_percent:g} % between two checks, at "
        f"{fit.point_s:.2g} s for a point"
    )
    stated, proposed = plan.rig.lamp.u_flicker, proposed_flicker(fit.flicker)
    if max(stated, proposed) > _DIFFERS * min(stated, proposed):
        yield (
            f"proposed for the rig file: lamp: {{u_flicker: {proposed:g}}} in place of {stated:g}"
        )
    if fit.drift.chi2 > _WANDERS:
        yield (
            f"the readings scatter about the fit more than noise and flicker explain (chi² "
            f"{fit.drift.chi2:.3g} for each): the lamp wanders, and the u are enlarged"
        )


def _not_steady(fit: LampFit, plan: LampPlan, end_s: float) -> str:
    """Return what is known of a lamp that was not seen steady."""
    steady = fit.drift.steady(plan.limit, plan.within_s)
    words = (
        f"the lamp was not steady after {duration_text(end_s)}: its light changes by "
        f"{100 * fit.change.value:+.2g} % (u {100 * fit.change.u:.1g} %) within "
        f"{plan.within_minutes:g} min; allowed: {plan.limit_percent:g} % (3 u)"
    )
    if steady is None:
        return f"{words}. Its steady drift alone is too large: look at its supply, or allow more"
    if steady.value > end_s:
        return f"{words}. By the fit it is steady {duration_text(steady.value)} after the start"
    return f"{words}. Watch it for longer (--minutes), or take more frames (--frames)"
