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

from acquisition.drift import Drift, rate
from analysis.measurements import SharedError
from instrument.geometry import FloatArray
from instrument.protocol_config import Protocol
from instrument.record import Reading

NOISE, ROUNDING, DRIFT = "photon and read noise", "rounding to counts", "lamp drift"
DARK, PLACEMENT = "rounding of the dark", "sample placement"
TILE_READING, TILE = "white tile reading", "white tile certificate"


@dataclass(frozen=True, slots=True)
class Reduced:
    """All points of a run, arrays of shape (N,). brdf in 1/sr, nan where no reference was taken.

    `components`: relative standard uncertainties by name, independent from point to point.
    `shared`: those of the radiance that points share; `shared_by_tile`: those that the comparison
    with the tile adds. `drift`: time in s and lamp level of each check.
    """

    points: tuple[Reading, ...]
    radiance: FloatArray
    brdf: FloatArray
    components: Mapping[str, FloatArray]
    shared: tuple[SharedError, ...]
    shared_by_tile: tuple[SharedError, ...]
    flags: tuple[str, ...]
    drift: tuple[tuple[float, float], ...]

    @property
    def parts(self) -> dict[str, FloatArray]:
        """Every relative standard uncertainty of the BRDF by name, shared or not, 0 or more."""
        shared = {e.name: np.abs(e.u_relative) for e in (*self.shared, *self.shared_by_tile)}
        return {**self.components, **shared}

    @property
    def u_radiance(self) -> FloatArray:
        """Standard uncertainty of the radiance, in its unit."""
        own = [*self.components.values(), *(e.u_relative for e in self.shared)]
        return np.abs(self.radiance) * root_sum_square(own)

    @property
    def sound(self) -> NDArray[np.bool_]:
        """Points that may enter a fit: measured against a tile, and nothing flagged."""
        unflagged = np.array([not flags for flags in self.flags], dtype=bool)
        return unflagged & np.isfinite(self.brdf) & (self.radiance > 0)


@dataclass(frozen=True, slots=True)
class _Tile:
    """The white tile's reading for one place of the lamp."""

    rate: float
    u_relative: float
    flags: str


def root_sum_square(parts: Sequence[FloatArray]) -> FloatArray:
    """Independent uncertainties (N,) taken together."""
    total: FloatArray = np.sqrt(np.sum(np.square(parts), axis=0))
    return total


def reduce(readings: Sequence[Reading], protocol: Protocol) -> Reduced:
    """Work out radiance and BRDF of all points of a run."""
    points = tuple(r for r in readings if r.kind == "point")
    drifts = {block: Drift.of(readings, block) for block in sorted({r.block for r in readings})}
    tiles = {r.lamp_setting: _tile(r, drifts[r.block]) for r in readings if r.kind == "tile"}
    radiance = np.array([rate(p) / drifts[p.block].at(p.time_s) for p in points])
    tile = protocol.references.white_tile
    known = tile.reflectance / np.pi if tile is not None else np.nan
    white = np.array([tiles[p.lamp_setting].rate if tiles else np.nan for p in points])
    return Reduced(
        points,
        radiance,
        radiance / white * known,
        _components(points, drifts),
        _shared(points),
        _shared_by_tile(points, tiles, protocol) if tiles else (),
        tuple(_flags(p, tiles.get(p.lamp_setting)) for p in points),
        tuple(
            (float(time_s), float(level))
            for drift in drifts.values()
            for time_s, level in zip(drift.times_s, drift.level, strict=True)
        ),
    )


def _relative(points: Sequence[Reading], name: str) -> FloatArray:
    """One of the readings' uncertainties relative to the signal; nan where that is nought."""
    signal = np.array([p.signal_dn or np.nan for p in points])
    relative: FloatArray = np.array([getattr(p, name) for p in points]) / signal
    return relative


def _tile(reading: Reading, drift: Drift) -> _Tile:
    names = ("u_noise_dn", "u_quantisation_dn", "u_dark_dn", "u_placement_dn")
    counts = [_relative([reading], name)[0] for name in names]
    return _Tile(
        rate(reading) / drift.at(reading.time_s),
        float(np.linalg.norm([*counts, drift.u_beyond(reading.time_s)])),
        reading.flags,
    )


def _components(points: Sequence[Reading], drifts: Mapping[int, Drift]) -> dict[str, FloatArray]:
    return {
        NOISE: np.abs(_relative(points, "u_noise_dn")),
        ROUNDING: np.abs(_relative(points, "u_quantisation_dn")),
        DRIFT: np.array([drifts[p.block].u_level for p in points]),
    }


def _shared(points: Sequence[Reading]) -> tuple[SharedError, ...]:
    """One dark serves an exposure, and the sample is placed once a block."""
    exposures = np.unique([p.exposure_s for p in points], return_inverse=True)[1]
    blocks = np.array([p.block for p in points], dtype=np.int64)
    return (
        SharedError(DARK, _relative(points, "u_dark_dn"), exposures.astype(np.int64)),
        SharedError(PLACEMENT, _relative(points, "u_placement_dn"), blocks),
    )


def _shared_by_tile(
    points: Sequence[Reading], tiles: Mapping[int, _Tile], protocol: Protocol
) -> tuple[SharedError, ...]:
    """The tile is read once for every place of the lamp; its certificate holds for all."""
    tile = protocol.references.white_tile
    if tile is None:
        return ()
    settings = np.array([p.lamp_setting for p in points], dtype=np.int64)
    u_reading = np.array([tiles[p.lamp_setting].u_relative for p in points])
    u_certificate = tile.u_reflectance / tile.reflectance
    return (
        SharedError(TILE_READING, u_reading, settings),
        SharedError.of_all(TILE, u_certificate, len(points)),
    )


def _flags(point: Reading, tile: _Tile | None) -> str:
    tile_flags = f"white tile {tile.flags}" if tile is not None and tile.flags else ""
    return "; ".join(f for f in (point.flags, tile_flags) if f)
