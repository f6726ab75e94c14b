"""Catalogue of the faults of the world that whole scans are attacked with."""

from __future__ import annotations

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

# Attacks that nothing in the data can tell, with the reason: their points may be wrong in silence.
_UNTIED = "nothing ties the tile's pictures to the first drift check, after the swap"
_PASSED = "a whole point between two drift checks, whose frames agree with one another"
_ONE_LAMP = "a wrong angle from the beginning shows only where the tile is seen at two incidences"
_BARE = "a bare table looks like a dark sample without edges"
_NO_AZIMUTH = "neither tile nor outline shows the lamp's azimuth"
UNSEEN = {
    "lamp dies after the tile": _UNTIED,
    "exposure changed after the tile": _UNTIED,
    "theta_i slips after the tile": _UNTIED,
    "shutter shut during the tile": _UNTIED,
    "sample left on the table": _UNTIED,
    "tile left on the table": _UNTIED,
    "lamp dips between checks": _PASSED,
    "room light for a while": _PASSED,
    "hand in the beam": _PASSED,
    "theta_i set wrong": _ONE_LAMP,
    "dphi slips": _NO_AZIMUTH,
    "tile on the table at the resume": _BARE,
}
