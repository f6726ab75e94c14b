"""Effects of the camera's sensor: counts out of proportion, a dark that drifts, unequal pixels."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acquisition.results.effects.effect import Effect, Readings
from instrument.geometry import FloatArray
from instrument.record.reading import Reading

NONLINEAR, DARK_DRIFT, FLAT = "counts out of proportion", "dark current drift", "flat field"


def sensor_effects(readings: Readings) -> Iterator[Effect]:
    """Yield the effects whose size or u the rig file states."""
    lines = readings.rig.uncertainty
    if lines.u_linearity:
        yield Effect(name=NONLINEAR, by_one=_excess(readings), u=lines.u_linearity)
    if lines.u_dark_drift_electrons_per_s_per_h:
        u = lines.u_dark_drift_electrons_per_s_per_h
        yield Effect(name=DARK_DRIFT, by_one=_dark_drift(readings), u=u)
    if lines.u_pixel_response:
        u, by_one = lines.u_pixel_response, _unequal_pixels(readings)
        yield Effect(name=FLAT, by_one=by_one, u=u, independent=True)


def _excess(readings: Readings) -> FloatArray:
    """Excess of the counts, (N,), over those of the tile: it falls in proportion to the counts."""
    camera = readings.rig.camera
    full_dn = camera.max_dn - camera.black_level_dn
    share, of_tile = (of("signal_dn") / full_dn for of in (readings.of_points, readings.of_tiles))
    return of_tile - share if readings.absolute else -share


def _dark_drift(readings: Readings) -> FloatArray:
    """Relative change of the signal, (N,), by a drift of 1 electron per s per h of the dark.

    The dark of an exposure is taken when that exposure is first used.
    """
    tiles = [t for t in readings.tiles if t is not None]
    begun: dict[float, float] = {}
    for reading in sorted((*readings.points, *tiles), key=lambda r: r.time_s):
        begun.setdefault(reading.exposure_s, reading.time_s)
    gain = readings.rig.camera.electrons_per_dn

    def change(reading: Reading | None) -> float:
        if reading is None or not reading.signal_dn:
            return np.nan
        hours = (reading.time_s - begun[reading.exposure_s]) / 3600.0
        return hours * reading.exposure_s / (gain * reading.signal_dn)

    own = np.array([change(p) for p in readings.points])
    return own - np.array([change(t) for t in readings.tiles]) if readings.absolute else own


def _unequal_pixels(readings: Readings) -> FloatArray:
    """Standard deviation, (N,), of a window's mean from the tile's, in units of a single pixel's.

    The smaller of the two windows lies within the larger one, and has its pixels.
    """
    of_points = 1 / np.maximum(readings.of_points("window_pixels"), 1.0)
    if not readings.absolute:
        return np.sqrt(of_points)
    return np.sqrt(np.abs(of_points - 1 / np.maximum(readings.of_tiles("window_pixels"), 1.0)))
