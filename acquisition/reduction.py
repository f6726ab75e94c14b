"""From the record's counts to radiance and BRDF, each with the uncertainties it came with.

radiance = counts per second, corrected for the lamp's drift: relative, as the rig has no absolute
calibration. brdf = (radiance of the sample / radiance of the white tile under the same lamp) times
reflectance / pi of the tile, taken as Lambertian (Nicodemus et al. 1977, section 3).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from instrument.geometry import FloatArray
from instrument.protocol_config import Protocol
from instrument.record import Reading

NOISE, ROUNDING, DRIFT = "photon and read noise", "rounding to counts", "lamp drift"


@dataclass(frozen=True, slots=True)
class Reduced:
    """All points of a run, arrays of shape (N,). brdf in 1/sr, nan where no reference was taken.

    `components`: relative standard uncertainties of single points, by name; independent from point
    to point. `u_reference`: relative, of the tile's reading, common to all points divided by it
    (`reference` numbers them, -1 for none). `u_tile`: relative, of its certificate, common to all.
    `u_placement`: relative and signed, of how the sample stands on the axis: common to a block,
    as it is placed once. `drift`: time in s and lamp level of each check.
    """

    points: tuple[Reading, ...]
    radiance: FloatArray
    brdf: FloatArray
    components: Mapping[str, FloatArray]
    reference: NDArray[np.int64]
    u_reference: FloatArray
    u_tile: float
    u_placement: FloatArray
    flags: tuple[str, ...]
    drift: tuple[tuple[float, float], ...]

    @property
    def u_random(self) -> FloatArray:
        """Relative standard uncertainty that points do not share."""
        total: FloatArray = np.sqrt(np.sum([c**2 for c in self.components.values()], axis=0))
        return total

    @property
    def u_radiance(self) -> FloatArray:
        """Standard uncertainty of the radiance, in its unit."""
        u: FloatArray = np.abs(self.radiance) * np.hypot(self.u_random, self.u_placement)
        return u

    @property
    def sound(self) -> NDArray[np.bool_]:
        """Points that may enter a fit: measured against a tile, and nothing flagged."""
        unflagged = np.array([not flags for flags in self.flags], dtype=bool)
        return unflagged & np.isfinite(self.brdf) & (self.radiance > 0)


@dataclass(frozen=True, slots=True)
class _Drift:
    """The lamp of one block relative to its first check."""

    times_s: FloatArray
    level: FloatArray
    u_level: float

    @property
    def _slope_per_s(self) -> float:
        """Mean change over all checks."""
        if self.times_s.size < 2:
            return 0.0
        return float((self.level[-1] - self.level[0]) / (self.times_s[-1] - self.times_s[0]))

    def _outside_s(self, time_s: float) -> float:
        """Seconds from the nearest check, negative before the first, 0 between them."""
        if not self.times_s.size:
            return 0.0
        return float(time_s - np.clip(time_s, self.times_s[0], self.times_s[-1]))

    def at(self, time_s: float) -> float:
        """Level by straight lines between the checks, and by the mean slope beyond them."""
        if not self.times_s.size:
            return 1.0
        inside = float(np.interp(time_s, self.times_s, self.level))
        return inside + self._slope_per_s * self._outside_s(time_s)

    def u_beyond(self, time_s: float) -> float:
        """Standard uncertainty of the level beyond the checks: half of what was extrapolated."""
        return abs(self._slope_per_s * self._outside_s(time_s)) / 2


@dataclass(frozen=True, slots=True)
class _Tile:
    number: int
    rate: float
    u_relative: float
    flags: str


def reduce(readings: Sequence[Reading], protocol: Protocol) -> Reduced:
    """Work out radiance and BRDF of all points of a run."""
    points = tuple(r for r in readings if r.kind == "point")
    drifts = {block: _drift(readings, block) for block in {r.block for r in readings}}
    tiles = _tiles(readings, drifts)
    tile = protocol.references.white_tile
    rate = np.array([_rate(p) / drifts[p.block].at(p.time_s) for p in points])
    own = [tiles.get(p.lamp_setting) for p in points]
    known = tile.reflectance / np.pi if tile is not None else np.nan
    white = np.array([np.nan if t is None else t.rate for t in own])
    return Reduced(
        points,
        rate,
        rate / white * known,
        _components(points, drifts),
        np.array([-1 if t is None else t.number for t in own]),
        np.array([0.0 if t is None else t.u_relative for t in own]),
        0.0 if tile is None else tile.u_reflectance / tile.reflectance,
        np.array([p.u_placement_dn / p.signal_dn if p.signal_dn else np.nan for p in points]),
        tuple(_flags(p, t) for p, t in zip(points, own, strict=True)),
        tuple(
            (float(time_s), float(level))
            for _, drift in sorted(drifts.items())
            for time_s, level in zip(drift.times_s, drift.level, strict=True)
        ),
    )


def _rate(reading: Reading) -> float:
    return reading.signal_dn / reading.exposure_s


def _u_counts(reading: Reading) -> float:
    """Relative standard uncertainty of a reading's counts."""
    u_dn = np.linalg.norm([reading.u_noise_dn, reading.u_quantisation_dn, reading.u_placement_dn])
    return float(u_dn / abs(reading.signal_dn)) if reading.signal_dn else float("nan")


def _drift(readings: Sequence[Reading], block: int) -> _Drift:
    checks = [r for r in readings if r.kind == "drift" and r.block == block and not r.flags]
    rates = np.array([_rate(r) for r in checks])
    times = np.array([r.time_s for r in checks])
    level = rates / rates[0] if rates.size else rates
    # The same geometry again: placement and rounding are the same each time, noise is not.
    noise = [r.u_noise_dn / r.signal_dn for r in checks]
    # A level is the ratio of two checks.
    u_level = float(np.sqrt(2.0) * np.median(noise)) if noise else 0.0
    return _Drift(times, level, u_level)


def _tiles(readings: Sequence[Reading], drifts: Mapping[int, _Drift]) -> dict[int, _Tile]:
    """The white tile's reading for every place of the lamp."""
    tiles = [r for r in readings if r.kind == "tile"]
    return {
        r.lamp_setting: _Tile(
            number,
            _rate(r) / drifts[r.block].at(r.time_s),
            float(np.hypot(_u_counts(r), drifts[r.block].u_beyond(r.time_s))),
            r.flags,
        )
        for number, r in enumerate(tiles)
    }


def _components(points: Sequence[Reading], drifts: Mapping[int, _Drift]) -> dict[str, FloatArray]:
    signal = np.array([abs(p.signal_dn) for p in points])
    return {
        NOISE: np.array([p.u_noise_dn for p in points]) / signal,
        ROUNDING: np.array([p.u_quantisation_dn for p in points]) / signal,
        DRIFT: np.array([drifts[p.block].u_level for p in points]),
    }


def _flags(point: Reading, tile: _Tile | None) -> str:
    tile_flags = f"white tile {tile.flags}" if tile is not None and tile.flags else ""
    return "; ".join(f for f in (point.flags, tile_flags) if f)
