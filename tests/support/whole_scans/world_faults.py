"""Catalogue of the faults of the world that whole scans are attacked with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from instrument.config.load import Loaded
from instrument.config.protocol import angles_deg
from tests.support.whole_scans.world_attacks import (
    Attack,
    after_tile,
    always,
    grows,
    on_tile,
    passes,
    stays,
)

LIGHT, FRAMES, OUTLINE, DARKS = "light", "frames", "outline", "darks"

ATTACKS = (
    Attack("lamp dies after the tile", "lamp", ("0", "0.02"), after_tile, LIGHT),
    Attack("exposure changed after the tile", "exposure", ("1.5", "0.9"), after_tile, LIGHT),
    Attack("theta_i slips after the tile", "theta_i_deg", ("5", "-2"), after_tile, LIGHT),
    Attack("lamp dies in mid-scan", "lamp", ("0", "0.02"), stays, LIGHT),
    Attack("lamp jumps", "lamp", ("0.95", "1.02"), stays, LIGHT),
    Attack("lamp dips between checks", "lamp", ("0.9", "0.98"), passes, LIGHT),
    Attack("lamp flickers from a moment on", "flicker", ("0.02", "0.005"), stays, FRAMES),
    Attack("lamp flickers always", "flicker", ("0.02", "0.005"), always, FRAMES),
    Attack("shutter falls shut", "shutter_open", ("0", "0.5"), stays, LIGHT),
    Attack("shutter shut during the tile", "shutter_open", ("0", "0.5"), on_tile, LIGHT),
    Attack("shutter stays open in the darks", "shutter_shut", ("1", "0.5"), always, DARKS),
    Attack("darks leak", "shutter_shut", ("0.1", "0.02"), always, DARKS),
    Attack("darks leak from a moment on", "shutter_shut", ("0.1", "0.02"), stays, DARKS),
    Attack("room light switched on", "room", ("0.2", "0.01"), stays, LIGHT),
    Attack("room light for a while", "room", ("0.2", "0.01"), passes, LIGHT),
    Attack("stray light on a spot", "spot", ("20", "0.3"), stays, FRAMES),
    Attack("glare", "glare", ("0.1", "0.02"), stays, LIGHT),
    Attack("hand in the beam", "shadow", ("1", "0.47"), passes, OUTLINE),
    Attack("cable in the beam", "shadow", ("0.5", "0.42"), stays, OUTLINE),
    Attack("dew on the lens", "lens", ("0.8", "0.97"), grows, LIGHT),
    Attack("dust on the lens", "lens", ("0.8", "0.97"), stays, LIGHT),
    Attack("focus lost", "blur_mm", ("1", "0.3"), stays, OUTLINE),
    Attack("theta_r slips", "theta_r_deg", ("5", "2"), stays, OUTLINE),
    Attack("theta_r loses steps", "theta_r_deg", ("-5", "-2"), grows, OUTLINE),
    Attack("theta_i slips", "theta_i_deg", ("5", "-2"), stays, LIGHT),
    Attack("theta_i set wrong", "theta_i_deg", ("-5", "2"), always, LIGHT),
    Attack("dphi slips", "dphi_deg", ("20", "5"), stays, OUTLINE),
    Attack("sample shifted", "shift_mm", ("15", "3"), stays, OUTLINE),
    Attack("sample turned", "turn_deg", ("30", "5"), stays, OUTLINE),
    Attack("sample tilted", "tilt_deg", ("3", "-1"), stays, OUTLINE),
    Attack("sample falls off", "mounted", ("nothing", "white tile"), stays, OUTLINE),
    Attack("tile left on the table", "mounted", ("white tile", "nothing"), after_tile, OUTLINE),
    Attack("sample left on the table", "mounted", ("sample", "nothing"), on_tile, OUTLINE),
    Attack("exposure changed, reported", "control", ("2", "0.8"), stays, FRAMES),
    Attack("exposure changed, unreported", "exposure", ("1.5", "0.9"), stays, LIGHT),
    Attack("gain changed", "gain", ("1.5", "1.1"), stays, FRAMES),
    Attack("amplifier drifts", "amplifier", ("1.5", "1.1"), stays, LIGHT),
    Attack("black level shifts", "black_dn", ("20", "5"), stays, DARKS),
    Attack("response bends", "gamma", ("0.8", "0.97"), stays, FRAMES),
    Attack("noise vanishes", "noise", ("0", "0.3"), stays, FRAMES),
    Attack("hot pixels appear", "hot_px", ("20", "4"), stays, FRAMES),
    Attack("columns die", "dead_columns", ("20", "1"), stays, FRAMES),
    Attack("a bit is stuck", "stuck_bit", ("6", "3"), stays, FRAMES),
    Attack("a frame partly black", "black_rows", ("0.5", "0.1"), stays, FRAMES),
    Attack("one frame partly black", "black_rows", ("0.6", "0.45"), passes, FRAMES),
    Attack("a frame repeated", "repeats", ("1", "1"), stays, FRAMES),
    Attack("a stale frame first", "stale", ("1", "1"), stays, FRAMES),
    Attack("the same picture for ever", "frozen", ("1", "1"), stays, FRAMES),
)


@dataclass(frozen=True, slots=True)
class Unseen:
    """Attack that nothing in the data can tell: its points may be wrong in silence.

    sizes: at which it may. where: scans in which it may.
    """

    reason: str
    sizes: tuple[str, ...]
    where: Callable[[Loaded], bool] = lambda _loaded: True


def _read_once(loaded: Loaded) -> bool:
    tile = loaded.protocol.references.white_tile
    return tile is not None and not tile.again_at_end


def _incidences_deg(loaded: Loaded) -> list[float]:
    return [float(a) for sweep in loaded.protocol.sweeps for a in angles_deg(sweep["theta_i_deg"])]


def _once_or_at_normal(loaded: Loaded) -> bool:
    return _read_once(loaded) or max(_incidences_deg(loaded)) < _NORMAL_DEG


def _checked_at_normal(loaded: Loaded) -> bool:
    """True where the drift checks, and tile readings after them, have the lamp at the normal."""
    angles = _incidences_deg(loaded)
    return (angles[0] if _read_once(loaded) else max(angles)) < _NORMAL_DEG


_NORMAL_DEG = 10.0  # the cosine law hardly shows the angle of a lamp nearer to the normal
_UNTIED = "nothing ties the tile's pictures to the first drift check unless it is read again"
_PASSED = "a whole point between two drift checks, whose frames agree with one another"
_ONE_LAMP = "a wrong angle from the beginning shows only where the tile is seen at two incidences"
_BARE = "a bare table looks like a dark sample without edges"
_COSINE = "the drift checks stand at the normal, where the light hardly follows the lamp's angle"
_NO_AZIMUTH = "neither tile nor outline shows the lamp's azimuth"
_WARMING = "before the second drift check, and as small, it is taken for a lamp that warms up"
UNSEEN = {
    "lamp dies after the tile": Unseen(_UNTIED, ("0.02",), _read_once),
    "exposure changed after the tile": Unseen(_UNTIED, ("1.5", "0.9"), _read_once),
    "theta_i slips after the tile": Unseen(_UNTIED, ("5", "-2"), _once_or_at_normal),
    "shutter shut during the tile": Unseen(_UNTIED, ("0.5",), _read_once),
    "sample left on the table": Unseen(_UNTIED, ("nothing",), _read_once),
    "tile left on the table": Unseen(_UNTIED, ("nothing",), _read_once),
    "lamp dips between checks": Unseen(_PASSED, ("0.9", "0.98")),
    "room light for a while": Unseen(_PASSED, ("0.2", "0.01")),
    "hand in the beam": Unseen(_PASSED, ("1", "0.47")),
    "room light switched on": Unseen(_WARMING, ("0.01",)),
    "theta_i slips": Unseen(_COSINE, ("5", "-2"), _checked_at_normal),
    "theta_i set wrong": Unseen(_ONE_LAMP, ("-5", "2")),
    "dphi slips": Unseen(_NO_AZIMUTH, ("20",)),
    "tile on the table at the resume": Unseen(_BARE, ("nothing",)),
}


def may_be_silent(name: str, size: str, loaded: Loaded) -> bool:
    """Return True for an attack that nothing can tell in this scan."""
    unseen = UNSEEN.get(name)
    return unseen is not None and size in unseen.sizes and unseen.where(loaded)
