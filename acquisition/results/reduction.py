"""Radiance and BRDF of a run, from the record's counts, with each component of uncertainty.

radiance: counts per second, corrected for lamp drift. It is relative: the rig has no absolute
calibration. BRDF: radiance of the sample over that of the white tile at the same lamp setting,
times the tile's radiance factor / pi at the angles of its reading (Nicodemus et al. 1977, section
3; `acquisition.measure.white_tile`). Use `reduced_run` for a record, and `reduce` for readings in
memory.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from acquisition.interlocks.doubt import DOUBTED, doubted_steps
from acquisition.interlocks.lamp_checks import UNPROVEN, doubtful_steps
from acquisition.interlocks.no_light import NO_SIGNAL, unlit_steps
from acquisition.measure.drift import Drift, rate
from acquisition.measure.placement import tilt_deg
from acquisition.measure.scattering import StrayLight, stray_light
from acquisition.measure.white_tile import Standard, standard
from acquisition.results.effects.effect import Readings
from acquisition.results.effects.flicker import with_flicker
from acquisition.results.effects.lamp_level import drift_between, drift_noise, wander
from acquisition.results.effects.lens import STRAY
from acquisition.results.effects.rig_effects import has_effects, rig_effects
from acquisition.results.effects.turning import BLUR, turning_errors
from analysis.data.measurements import SharedError
from analysis.fit.certificate import CERTIFICATE
from instrument.config.load import Loaded
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.errors import AllFlagged, NoMeasurement, NotDetermined
from instrument.geometry import BoolArray, FloatArray
from instrument.record.reading import Check, Reading, Rows
from instrument.record.record import Record

# Components of uncertainty, and flags of points, as files and reports call them.
NOISE, ROUNDING = "photon and read noise", "rounding to counts"
LINEARITY = "linearity of the camera"
DARK, PLACEMENT, TEXTURE = "dark frames", "sample placement", "texture at the window edge"
NO_TILE_YET = "no white tile yet"
TILE_READING, TILE = "white tile reading", CERTIFICATE
TILE_PLACEMENT = "white tile placement"
Doubts = Mapping[str, Container[int]]  # steps by flag
_ANGLES = ("theta_i_deg", "theta_r_deg")


@dataclass(frozen=True, slots=True, kw_only=True)
class Reduced:
    """Points of a run, complete or not: arrays of shape (N,).

    radiance: in counts/s. brdf: in 1/sr, NaN where there is no white tile.
    components: relative standard uncertainties by name, independent from point to point.
    shared: errors of the radiance that points share. shared_by_tile: those that the comparison
        with the white tile adds.
    flags: empty for a good point.
    drift_levels: lamp level relative to the first check, at each usable check, one array a block.
    drift_checks: number of drift checks that were made. drift_scatter: of their levels about a
        steady drift, in units of their noise. drifts: by block.
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
    drift_scatter: float = 1.0
    drifts: Mapping[int, Drift] = field(default_factory=dict)

    @property
    def parts(self) -> dict[str, FloatArray]:
        """Standard uncertainties of the BRDF by name, (N,) and relative, independent and shared."""
        found = dict(self.components)
        for error in (*self.shared, *self.shared_by_tile):
            so_far = found.get(error.name, np.zeros(len(self.points)))
            found[error.name] = np.hypot(so_far, error.u_relative)
        return found

    def u_independent(self, without: Iterable[str] = ()) -> FloatArray:
        """Relative u of each point, dimensionless (N,): what no other shares and no fit models.

        `without`: further components that are left out.
        """
        left_out = {BLUR, *without}
        return root_sum_square([u for name, u in self.components.items() if name not in left_out])

    @property
    def u_radiance(self) -> FloatArray:
        """Standard uncertainty of the radiance, (N,) in counts/s."""
        own = [*self.components.values(), *(e.u_relative for e in self.shared)]
        return np.abs(self.radiance) * root_sum_square(own)

    @property
    def valid(self) -> BoolArray:
        """True for points to fit, (N,): without flags, and with a BRDF if any point has one."""
        unflagged = np.array([not flags for flags in self.flags], dtype=bool)
        return unflagged & np.isfinite(self.brdf if self.has_brdf else self.radiance)

    @property
    def has_brdf(self) -> bool:
        """True if at least one point has a BRDF, relative to a white tile."""
        return bool(np.any(np.isfinite(self.brdf)))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tile:
    """Reading of the white tile at one lamp setting: counts/s, relative u and flags.

    u_own: of noise, rounding, dark and drift. u_placement: signed; the readings that have the same
    number in `placement` share its error.
    """

    rate: float
    u_own: float
    u_placement: float
    placement: int
    flags: str


def root_sum_square(parts: Sequence[FloatArray]) -> FloatArray:
    """Combine independent standard uncertainties, (N,) each and in one unit."""
    total: FloatArray = np.sqrt(np.sum(np.square(parts), axis=0))
    return total


def reduced_run(record: Record, loaded: Loaded) -> Reduced:
    """Return radiance and BRDF of all points in a run's record, complete or not."""
    return reduced_rows(record.rows(), loaded)


def reduced_rows(rows: Rows, loaded: Loaded) -> Reduced:
    """Return radiance and BRDF of all points in rows of a record, complete or not."""
    readings, checks = with_flicker(rows.readings, rows.checks, loaded.rig)
    doubted = doubted_steps(readings, rows.events)
    stray = stray_light(readings, loaded.rig)
    own = readings if stray is None else stray.subtracted(readings)
    reduced = reduce(own, loaded.protocol, checks, doubted)
    blurred, turned = turning_errors(reduced.points, reduced.radiance)
    if blurred:
        components = {**reduced.components, **blurred}
        reduced = replace(reduced, components=components, shared=(*reduced.shared, *turned))
    if stray is not None:
        errors = _stray_light_errors(reduced.points, _tile_readings(own), stray)
        reduced = replace(reduced, shared=(*reduced.shared, *errors))
    if has_effects(loaded.rig.uncertainty):
        reduced = with_rig_effects(reduced, own, loaded)
    measured = loaded.rig.camera.measured
    if measured is None:
        return reduced
    # The response is wrong alike at equal counts only, and what is common is part of the scale.
    u = np.full(len(reduced.points), measured.u_light_relative)
    return replace(reduced, components={**reduced.components, LINEARITY: u})


def with_rig_effects(reduced: Reduced, readings: Sequence[Reading], loaded: Loaded) -> Reduced:
    """Return the run with the effects that its rig file states: corrected, and their u added."""
    theta_i = np.radians([p.theta_i_deg for p in reduced.points])
    tiles = _tile_readings(readings)
    found = rig_effects(
        Readings(
            points=reduced.points,
            tiles=[tiles.get(p.lamp_setting) for p in reduced.points],
            value=reduced.brdf if reduced.has_brdf else reduced.radiance / np.cos(theta_i),
            absolute=reduced.has_brdf,
            rig=loaded.rig,
            protocol=loaded.protocol,
        )
    )
    components = {**reduced.components, **found.components}
    if reduced.has_brdf:  # the radiance itself stays as measured
        return replace(
            reduced,
            brdf=reduced.brdf * found.factor,
            components=components,
            shared_by_tile=(*reduced.shared_by_tile, *found.shared),
        )
    return replace(
        reduced,
        radiance=reduced.radiance * found.factor,
        components=components,
        shared=(*reduced.shared, *found.shared),
    )


def require_usable(reduced: Reduced) -> None:
    """Raise where no point can be fitted.

    `NoMeasurement` if there is none yet, `NotDetermined` if the white tile is still to come, and
    `AllFlagged` if something is wrong with every point.
    """
    if np.any(reduced.valid):
        return
    if not reduced.points:
        raise NoMeasurement("no geometry has been measured yet: resume the scan")
    if NO_TILE_YET in reduced.flags:
        raise NotDetermined("no white tile has been read yet: resume the scan")
    kinds = ", ".join(sorted({kind for flags in reduced.flags for kind in flags.split("; ")}))
    raise AllFlagged(
        f"no measurement: all {len(reduced.points)} points are flagged ({kinds}); correct the "
        "cause and repeat the scan"
    )


def reduce(
    readings: Sequence[Reading],
    protocol: Protocol,
    checks: Sequence[Check],
    doubted: frozenset[int] = frozenset(),
) -> Reduced:
    """Return radiance and BRDF of all points; `checks`: the lamp checks made at each resume.

    doubted: steps whose surface was not proved to be at its place.
    """
    doubtful = doubtful_steps(readings, checks)
    left_out = doubtful | doubted
    readings = [r for r in readings if r.kind != "drift" or r.step not in left_out]
    points = tuple(r for r in readings if r.kind == "point")
    blocks = sorted({r.block for r in readings})
    drifts = {block: Drift.of(readings, block, checks) for block in blocks}
    doubts = {
        NO_SIGNAL: unlit_steps(readings),
        UNPROVEN: doubtful,
        DOUBTED: doubted,
    }
    placements = _placements(sorted(readings, key=lambda r: r.time_s))
    tiles = {
        setting: _tile(r, drifts[r.block], placements[r.step], doubts)
        for setting, r in _tile_readings(readings).items()
    }
    radiance = np.array([rate(p) / drifts[p.block].at(p.time_s) for p in points])
    tile = standard_of(points, protocol)
    known = tile.beta / np.pi if tile is not None else np.nan
    own = [tiles.get(p.lamp_setting) for p in points]
    white = np.array([np.nan if t is None else t.rate or np.nan for t in own])
    return Reduced(
        points=points,
        radiance=radiance,
        brdf=radiance / white * known,
        components={**_components(points), **wander(points, drifts)},
        shared=(
            *_shared(points, placements),
            *drift_noise(points, drifts),
            *drift_between(points, drifts),
        ),
        shared_by_tile=_shared_by_tile(points, own, tile),
        flags=tuple(
            _flags(p, t, tile is not None, doubts) for p, t in zip(points, own, strict=True)
        ),
        drift_levels=tuple(drift.level for drift in drifts.values()),
        drift_checks=sum(r.kind == "drift" for r in readings) + sum(c.jumped for c in checks),
        drift_scatter=max((drift.scatter for drift in drifts.values()), default=1.0),
        drifts=drifts,
    )


def shared_errors(reduced: Reduced, rig: Rig) -> tuple[SharedError, ...]:
    """All errors that points share, with the angles that a misplaced sample changes."""
    theta_i, theta_r = (np.array([getattr(p, n) for p in reduced.points]) for n in _ANGLES)
    by_i = tilt_deg(theta_i, rig.u_placement_mm, rig.lamp_distance_mm)
    by_r = tilt_deg(theta_r, rig.u_placement_mm, rig.beam_length_mm)
    return tuple(
        replace(error, theta_i_deg=by_i, theta_r_deg=by_r) if error.name == PLACEMENT else error
        for error in (*reduced.shared, *reduced.shared_by_tile)
    )


def standard_of(points: Sequence[Reading], protocol: Protocol) -> Standard | None:
    """Return the white tile's radiance factor for each point; None without a tile."""
    tile = protocol.references.white_tile
    if tile is None:
        return None
    theta_i, dphi = (np.array([getattr(p, n) for p in points]) for n in ("theta_i_deg", "dphi_deg"))
    return standard(tile, theta_i, dphi)


def _tile_readings(readings: Sequence[Reading]) -> dict[int, Reading]:
    """Return the tile's first reading at each lamp setting; one at its end only confirms it."""
    last_first = sorted(readings, key=lambda r: -r.step)
    return {r.lamp_setting: r for r in last_first if r.kind == "tile"}


def _stray_light_errors(
    points: Sequence[Reading], tiles: Mapping[int, Reading], stray: StrayLight
) -> tuple[SharedError, ...]:
    """Errors of the stray light: of how far the lens scatters it, and so the same in all readings.

    With a tile only the difference counts: what is too much in both leaves the ratio as it is.
    """
    errors = stray.errors_of(points) / np.array([p.signal_dn or np.nan for p in points])
    for setting, tile in tiles.items():
        own = np.array([p.lamp_setting == setting for p in points], dtype=bool)
        errors[:, own] -= stray.errors_of([tile]) / (tile.signal_dn or np.nan)
    alike = np.zeros(len(points), dtype=np.int64)
    return tuple(SharedError(STRAY, u, alike) for u in errors)


def _relative(points: Sequence[Reading], name: str) -> FloatArray:
    """One uncertainty of the readings relative to the signal; NaN where the signal is 0."""
    signal = np.array([p.signal_dn or np.nan for p in points])
    relative: FloatArray = np.array([getattr(p, name) for p in points]) / signal
    return relative


def _tile(reading: Reading, drift: Drift, placement: int, doubts: Doubts) -> _Tile:
    names = ("u_noise_dn", "u_quantisation_dn", "u_texture_dn", "u_dark_dn", "u_placement_dn")
    *own, u_placement = (float(_relative([reading], name)[0]) for name in names)
    of_lamp = drift.u_extrapolated(reading.time_s), drift.u_wander(reading.time_s)
    return _Tile(
        rate=rate(reading) / drift.at(reading.time_s),
        u_own=float(np.linalg.norm([*own, *of_lamp])),
        u_placement=u_placement,
        placement=placement,
        flags="; ".join((*_own_flags(reading, doubts), *[NO_SIGNAL] * (reading.signal_dn == 0))),
    )


def _components(points: Sequence[Reading]) -> dict[str, FloatArray]:
    return {
        NOISE: np.abs(_relative(points, "u_noise_dn")),
        ROUNDING: np.abs(_relative(points, "u_quantisation_dn")),
        TEXTURE: np.abs(_relative(points, "u_texture_dn")),
    }


def _shared(points: Sequence[Reading], placements: Mapping[int, int]) -> tuple[SharedError, ...]:
    """Errors of the darks, one for each exposure, and of the sample's placement after each swap."""
    exposures = np.unique([p.exposure_s for p in points], return_inverse=True)[1]
    placed = np.array([placements[p.step] for p in points], dtype=np.int64)
    return (
        SharedError(DARK, _relative(points, "u_dark_dn"), exposures.astype(np.int64)),
        SharedError(PLACEMENT, _relative(points, "u_placement_dn"), placed),
    )


def _placements(readings: Sequence[Reading]) -> dict[int, int]:
    """Number of swaps of sample and tile before each reading, by its step; in order of time."""
    before = (*readings[:1], *readings)
    changes = [a.surface != b.surface for a, b in zip(readings, before, strict=False)]
    steps = (r.step for r in readings)
    return dict(zip(steps, np.cumsum(changes, dtype=np.int64).tolist(), strict=True))


def _shared_by_tile(
    points: Sequence[Reading], tiles: Sequence[_Tile | None], tile: Standard | None
) -> tuple[SharedError, ...]:
    """Errors of the tile: its readings, its placements, and its certificate.

    One reading serves all points of a lamp setting, and one placement several readings.
    """
    if tile is None:
        return ()
    settings = np.array([p.lamp_setting for p in points], dtype=np.int64)
    own, placement = (
        np.array([np.nan if t is None else getattr(t, name) for t in tiles])
        for name in ("u_own", "u_placement")
    )
    placed = np.array([-1 if t is None else t.placement for t in tiles], dtype=np.int64)
    return (
        SharedError(TILE_READING, own, settings),
        SharedError(TILE_PLACEMENT, placement, placed),
        *(SharedError(TILE, u, group) for u, group in tile.errors),
    )


def _own_flags(reading: Reading, doubts: Doubts) -> list[str]:
    """Return the flags of one reading, and what later readings say against it."""
    doubtful = [flag for flag, steps in doubts.items() if reading.step in steps]
    return [flag for flag in (reading.flags, *doubtful) if flag]


def _flags(point: Reading, tile: _Tile | None, expected: bool, doubts: Doubts) -> str:
    flags = [
        *_own_flags(point, doubts),
        NO_TILE_YET if tile is None and expected else "",
        f"white tile {tile.flags}" if tile is not None and tile.flags else "",
    ]
    return "; ".join(f for f in flags if f)
