"""From the record's counts to radiance and BRDF, each with the uncertainties it came with.

radiance = counts per second, corrected for the lamp's drift: relative, as the rig has no absolute
calibration. brdf = (radiance of the sample / radiance of the white tile under the same lamp) times
reflectance / pi of the tile, taken as Lambertian (Nicodemus et al. 1977, section 3).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.measure.drift import Drift, rate
from analysis.data.measurements import SharedError
from instrument.config.load import Loaded
from instrument.config.protocol import Protocol
from instrument.geometry import BoolArray, FloatArray
from instrument.record.reading import Check, Reading
from instrument.record.record import Record

NOISE, ROUNDING, DRIFT = "photon and read noise", "rounding to counts", "lamp drift"
DARK, PLACEMENT, TEXTURE = "dark frames", "sample placement", "texture at the window edge"
NO_TILE_YET, NO_SIGNAL = "no white tile yet", "no signal"
TILE_READING, TILE = "white tile reading", "white tile certificate"


@dataclass(frozen=True, slots=True)
class Reduced:
    """All points of a run, arrays of shape (N,). brdf in 1/sr, nan where no reference was taken.

    `components`: relative standard uncertainties by name, independent from point to point.
    `shared`: those of the radiance that points share; `shared_by_tile`: those that the comparison
    with the tile adds. `drift_levels`: the lamp's level at each usable check, block by block, of
    `drift_checks` that were made.
    """

    points: tuple[Reading, ...]
    radiance: FloatArray
    brdf: FloatArray
    components: Mapping[str, FloatArray]
    shared: tuple[SharedError, ...]
    shared_by_tile: tuple[SharedError, ...]
    flags: tuple[str, ...]
    drift_levels: tuple[FloatArray, ...]
    drift_checks: int

    @property
    def parts(self) -> dict[str, FloatArray]:
        """Every relative standard uncertainty of the BRDF by name, shared or not, 0 or more."""
        found = dict(self.components)
        for error in (*self.shared, *self.shared_by_tile):
            sofar = found.get(error.name, np.zeros(len(self.points)))
            found[error.name] = np.hypot(sofar, error.u_relative)
        return found

    @property
    def u_radiance(self) -> FloatArray:
        """Standard uncertainty of the radiance, in its unit."""
        own = [*self.components.values(), *(e.u_relative for e in self.shared)]
        return np.abs(self.radiance) * root_sum_square(own)

    @property
    def sound(self) -> BoolArray:
        """Points that may enter a fit: nothing flagged, and measured against a tile if any was."""
        unflagged = np.array([not flags for flags in self.flags], dtype=bool)
        return unflagged & np.isfinite(self.brdf if self.has_brdf else self.radiance)

    @property
    def has_brdf(self) -> bool:
        """Whether a white tile ties the radiance to a BRDF, for one point at least."""
        return bool(np.any(np.isfinite(self.brdf)))


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


def reduced_run(record: Record, loaded: Loaded) -> Reduced:
    """Return radiance and BRDF of all points in a run's record, complete or not."""
    return reduce(record.readings(), loaded.protocol, record.checks())


def reduce(readings: Sequence[Reading], protocol: Protocol, checks: Sequence[Check]) -> Reduced:
    """Return radiance and BRDF of all points; `checks`: the lamp checks made at each resume."""
    points = tuple(r for r in readings if r.kind == "point")
    blocks = sorted({r.block for r in readings})
    drifts = {block: Drift.of(readings, block, checks) for block in blocks}
    tiles = {r.lamp_setting: _tile(r, drifts[r.block]) for r in readings if r.kind == "tile"}
    radiance = np.array([rate(p) / drifts[p.block].at(p.time_s) for p in points])
    tile = protocol.references.white_tile
    known = tile.reflectance / np.pi if tile is not None else np.nan
    own = [tiles.get(p.lamp_setting) for p in points]
    white = np.array([np.nan if t is None else t.rate for t in own])
    return Reduced(
        points,
        radiance,
        radiance / white * known,
        _components(points),
        (*_shared(readings, points), *_drift_noise(points, drifts)),
        _shared_by_tile(points, own, protocol),
        tuple(_flags(p, t, tile is not None) for p, t in zip(points, own, strict=True)),
        tuple(drift.level for drift in drifts.values()),
        sum(r.kind == "drift" for r in readings) + sum(check.jumped for check in checks),
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
        float(np.linalg.norm([*counts, drift.u_extrapolated(reading.time_s)])),
        reading.flags,
    )


def _components(points: Sequence[Reading]) -> dict[str, FloatArray]:
    return {
        NOISE: np.abs(_relative(points, "u_noise_dn")),
        ROUNDING: np.abs(_relative(points, "u_quantisation_dn")),
        TEXTURE: np.abs(_relative(points, "u_texture_dn")),
    }


def _shared(readings: Sequence[Reading], points: Sequence[Reading]) -> tuple[SharedError, ...]:
    """One dark serves an exposure; the sample is placed anew whenever the tile has been there."""
    exposures = np.unique([p.exposure_s for p in points], return_inverse=True)[1]
    placed = {r.step: n for n, r in zip(_placements(readings), readings, strict=True)}
    placements = np.array([placed[p.step] for p in points], dtype=np.int64)
    return (
        SharedError(DARK, _relative(points, "u_dark_dn"), exposures.astype(np.int64)),
        SharedError(PLACEMENT, _relative(points, "u_placement_dn"), placements),
    )


def _placements(readings: Sequence[Reading]) -> list[int]:
    """How often sample and tile had changed places before each reading."""
    before = (*readings[:1], *readings)
    changes = [a.surface != b.surface for a, b in zip(readings, before, strict=False)]
    return [int(n) for n in np.cumsum(changes)]


def _drift_noise(points: Sequence[Reading], drifts: Mapping[int, Drift]) -> tuple[SharedError, ...]:
    """The noise of the drift checks: each is shared by the points between its neighbours.

    A point has a part of the check before it and of the one after: one of these has an even
    number, the other an odd one, so two errors hold all of them. The third is that of its block's
    first check, to which the levels of the whole block are referred, with the opposite sign.
    """
    if not any(drift.level.size for drift in drifts.values()):
        return ()
    u_relative = np.zeros((3, len(points)))
    check = np.zeros((3, len(points)), dtype=np.int64)
    block, time_s = (np.array([getattr(p, n) for p in points]) for n in ("block", "time_s"))
    passed = 0
    for number, drift in drifts.items():
        own = np.flatnonzero(block == number)
        if drift.level.size and own.size:
            u, (before, share) = drift.u_relative, drift.interpolation(time_s[own])
            after = np.minimum(before + 1, u.size - 1)
            u_relative[0, own], check[0, own] = u[0], passed
            for made, part in ((before, 1.0 - share), (after, share)):
                row = np.where(made == 0, 0, 1 + made % 2)
                u_relative[row, own] -= part * u[made]
                check[row, own] = passed + made
        passed += drift.level.size
    return tuple(SharedError(DRIFT, u, group) for u, group in zip(u_relative, check, strict=True))


def _shared_by_tile(
    points: Sequence[Reading], tiles: Sequence[_Tile | None], protocol: Protocol
) -> tuple[SharedError, ...]:
    """The tile is read once for every place of the lamp; its certificate holds for all."""
    tile = protocol.references.white_tile
    if tile is None:
        return ()
    settings = np.array([p.lamp_setting for p in points], dtype=np.int64)
    u_reading = np.array([np.nan if t is None else t.u_relative for t in tiles])
    u_certificate = tile.u_reflectance / tile.reflectance
    return (
        SharedError(TILE_READING, u_reading, settings),
        SharedError.common_to_all(TILE, u_certificate, len(points)),
    )


def _flags(point: Reading, tile: _Tile | None, expected: bool) -> str:
    flags = [
        point.flags,
        NO_TILE_YET if tile is None and expected else "",
        f"white tile {tile.flags}" if tile is not None and tile.flags else "",
        NO_SIGNAL if point.signal_dn == 0 else "",
    ]
    return "; ".join(f for f in flags if f)
