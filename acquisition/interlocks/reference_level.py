"""References: white tile and drift check show light, and the tile as much as a white surface can.

The tile is white and matt: its reading follows the cosine of the angle of incidence, which tells a
lamp that stands at another angle than the operator says.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from acquisition.measure.drift import (
    JUMP_U,
    MIN_JUMP,
    MIN_SIGNAL_U,
    Drift,
    is_misplaced,
    rate,
    u_unknown_trend,
)
from acquisition.measure.placement import Placement
from instrument.config.axes import HandAxis
from instrument.config.protocol import WhiteTile
from instrument.config.rig import Rig
from instrument.record.reading import Reading

MOST_WHITE = 10.0
"""Times the rig file's prediction for a perfect white diffuser: it is an estimate."""
LAMP_OFF_DEG = 2.0
"""Lamp angle by which readings of the tile may differ from the expected law beyond 5 u."""
_FALLOFF = 0.08
"""Fall of a tile's radiance factor with 1 - cos(theta_i), where no table states it.

It lies between a perfect diffuser and sintered PTFE, whose factor falls by 0.2 (1.070 at 0, 0.966
at 60 deg: T. A. Germer, Applied Optics 56 (2017) 9333): neither is taken for a lamp at a wrong
angle, and one that is 5 deg off at 60 deg is noticed with either.
"""
_COVERAGE = 5.0
_NEXT_SETTING = 0.01  # change of the lamp's output when it is moved by hand (assumed)


def level_doubt(reading: Reading, rig: Rig) -> str:
    """Return why a reference is too dark or too bright, empty if it is neither."""
    if is_misplaced(reading):
        return ""
    name = f"{reading.surface} at theta_i {reading.theta_i_deg:g} deg"
    if not reading.signal_dn > MIN_SIGNAL_U * reading.u_light_dn:
        return (
            f"{name}: {reading.signal_dn:.3g} DN; expected: {MIN_SIGNAL_U:g} times its u of "
            f"{reading.u_light_dn:.2g} DN (noise, rounding, dark) or more"
        )
    cosine = math.cos(math.radians(reading.theta_i_deg))
    white_per_s = rig.lamp.white_electrons_per_s * cosine / rig.camera.electrons_per_dn
    if reading.kind == "tile" and rate(reading) > MOST_WHITE * white_per_s:
        return (
            f"{name}: {rate(reading):.3g} DN/s; expected from a white surface: {white_per_s:.3g} "
            f"DN/s by the rig file's white_electrons_per_s, and not {MOST_WHITE:g} times as much"
        )
    return ""


def angle_doubt(
    tile: Reading,
    other: Reading,
    drifts: Mapping[int, Drift],
    rig: Rig,
    white_tile: WhiteTile | None = None,
) -> str:
    """Return why a reading of the tile contradicts an earlier one, empty if it does not.

    `drifts`: of the lamp, by block. `white_tile`: a table in it is followed.
    """
    if other.flags or not other.signal_dn > 0:
        return ""
    own = [drifts[r.block] for r in (tile, other)]
    found, expected = _ratio(tile, other, own), _light(tile, white_tile) / _light(other, white_tile)
    allowed = math.hypot(_allowed(tile, rig), _allowed(other, rig))
    allowed += _lamp_change(tile, other, own)
    if abs(math.log(found / expected)) <= allowed:
        return ""
    return (
        f"white tile at theta_i {tile.theta_i_deg:g} deg: {found:.3g} times the light at "
        f"{other.theta_i_deg:g} deg; expected by the cosine law: {expected:.3g} within "
        f"{100 * allowed:.2g} %; both settings are measured again"
    )


def repeat_doubt(tile: Reading, before: Reading, drift: Drift, rig: Rig) -> str:
    """Return why a reading of the tile contradicts one by the same lamp setting, empty if not.

    Between the two somebody has put the sample on the table, and the tile again. `drift`: of the
    lamp in their block.
    """
    if before.flags or not before.signal_dn > 0:
        return ""
    found = _ratio(tile, before, [drift, drift])
    u = math.hypot(*(_u_repeated(r, drift, rig) for r in (tile, before)))
    if not drift.segments:
        u = math.hypot(u, u_unknown_trend(tile.time_s - before.time_s))
    allowed = MIN_JUMP + _COVERAGE * u
    if abs(math.log(found)) <= allowed:
        return ""
    return (
        f"white tile at theta_i {tile.theta_i_deg:g} deg: {found:.3g} times the light that it gave "
        f"before; expected: as much within {100 * allowed:.2g} %, but for the drift that was seen; "
        "all that was measured between is measured again"
    )


def _u_repeated(tile: Reading, drift: Drift, rig: Rig) -> float:
    """Return the relative standard uncertainty of a reading that is repeated by the same lamp."""
    own = math.hypot(tile.u_light_dn, tile.u_texture_dn, tile.u_placement_dn) / tile.signal_dn
    lamp = rig.axes.theta_i
    u_deg = 0.0 if isinstance(lamp, HandAxis) else lamp.u_deg  # one set by hand stays
    by_angle = math.radians(u_deg) * math.tan(math.radians(tile.theta_i_deg))
    return math.hypot(own, by_angle, drift.u_extrapolated(tile.time_s))


def _ratio(tile: Reading, other: Reading, drifts: Sequence[Drift]) -> float:
    """Return the ratio of two readings, without the drift that checks have seen."""
    rates = [rate(r) / drift.at(r.time_s) for r, drift in zip((tile, other), drifts, strict=True)]
    return rates[0] / rates[1]


def _light(reading: Reading, white_tile: WhiteTile | None) -> float:
    """Return the light of the tile by the cosine law and its table, relative to a perfect white."""
    values = None if white_tile is None else white_tile.values
    cosine = math.cos(math.radians(reading.theta_i_deg))
    if values is None:
        return cosine * (1 - _FALLOFF * (1 - cosine))
    return cosine * values.at(reading.theta_i_deg, reading.theta_r_deg, reading.dphi_deg).beta


def _allowed(tile: Reading, rig: Rig) -> float:
    """Return the relative deviation from the cosine law that one reading may have."""
    u_deg, theta_i_deg = rig.axes.theta_i.u_deg, tile.theta_i_deg
    off = math.radians(LAMP_OFF_DEG + _COVERAGE * u_deg)
    u_placement = Placement(rig.u_placement_mm, theta_i_deg, rig.lamp_distance_mm).u_irradiance
    u = math.hypot(tile.u_noise_dn / tile.signal_dn, u_placement)
    return math.hypot(off * math.tan(math.radians(theta_i_deg)), _COVERAGE * u)


def _lamp_change(tile: Reading, other: Reading, drifts: Sequence[Drift]) -> float:
    """Return the relative change of the lamp's output that may lie between two readings."""
    known = [abs(s.trend_per_s) for d in drifts for s in d.segments if s.times_s.size > 1]
    apart_s = abs(tile.time_s - other.time_s)
    between = max(known) * apart_s if known else JUMP_U * u_unknown_trend(apart_s)
    return between if tile.block == other.block else between + _NEXT_SETTING
