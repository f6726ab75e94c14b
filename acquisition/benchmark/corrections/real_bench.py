"""Scans of the shipped bench with the defects of a real one, drawn from a seed.

As a user would have it who has calibrated it: the white tile has a table, the camera's response is
corrected up to what a calibration leaves, the rig file states what no command measures. Each of
these can be left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from acquisition.benchmark.demo_scan import BINNING, binned, shipped_demo, shipped_rig
from instrument.calibration.tile_table import TileTable
from instrument.config.camera import DarkPatch
from instrument.config.load import Loaded
from instrument.config.protocol import DriftCheck, References, WhiteTile
from instrument.config.rig import Rig, SimulatedTile, Simulation
from instrument.config.simulated.sample import SimulatedSample
from instrument.geometry import FloatArray

SAMPLES = (
    SimulatedSample(model="oren_nayar", parameters={"albedo": 0.8, "sigma_deg": 30.0}),
    SimulatedSample(model="oren_nayar", parameters={"albedo": 0.15, "sigma_deg": 20.0}),
    SimulatedSample(model="lambert+ggx", parameters={"albedo": 0.4, "f0": 0.04, "alpha": 0.35}),
)
INCIDENCES_DEG = (15.0, 45.0, 60.0)
VIEWS_DEG = (-83.0, -78.0, -70.0, -62.0, -50.0, -35.0, -20.0, -5.0, 10.0, 25.0, 50.0, 68.0, 80.0)
TILE_VIEW_DEG = 10.0
_CALIBRATED_NONLINEARITY = 0.001  # what a calibration of the camera leaves
_CALIBRATED_ZERO_DEG = 0.01  # what a calibration of the geometry leaves of the zero of theta_r
_DARK_PATCH = DarkPatch(
    x_mm=0.0, y_mm=27.4, width_mm=40.0, height_mm=2.4, reflectance=0.0002, u_reflectance=0.0001
)


@dataclass(frozen=True, slots=True)
class Corrections:
    """Corrections of a scan; by default those that a calibrated bench has.

    lines: sizes in the rig file's section `uncertainty` that replace the shipped ones.
    """

    tile_table: bool = True
    response: bool = True
    drift_checks: bool = True
    zero: bool = False
    dark_patch: bool = False
    lines: dict[str, float] = field(default_factory=dict)


def real_bench(seed: int, corrections: Corrections) -> Loaded:
    """Return the scan of a seed: it draws the defects' sizes and chooses the sample."""
    loaded, rig = shipped_demo(), binned(shipped_rig("bench_real"))
    tile = rig.simulation.tile
    if tile is None:
        raise ValueError("bench_real.yaml: simulation.tile is missing; required here")
    sweep = {
        "theta_i_deg": list(INCIDENCES_DEG), "dphi_deg": [0.0], "theta_r_deg": list(VIEWS_DEG)
    }  # fmt: skip
    check = DriftCheck(theta_r_deg=TILE_VIEW_DEG, every_points=7)
    update: dict[str, Any] = {
        "sweeps": [sweep],
        "frames_per_point": 2,
        "simulated_sample": SAMPLES[seed % len(SAMPLES)],
        "references": References(
            white_tile=_tabled(tile) if corrections.tile_table else _one_number(tile),
            drift_check=check if corrections.drift_checks else None,
        ),
    }
    return replace(
        loaded, protocol=loaded.protocol.model_copy(update=update), rig=_rig(rig, seed, corrections)
    )


def drawn_defects(rig: Rig, seed: int, times: int) -> dict[str, Any]:
    """Return the rig's section `simulation`, to be drawn from a seed.

    Defects are those of pixels with `times` the sides.
    """
    own = rig.simulation.model_dump() | {"seed": seed, "drawn": True}
    own["camera_defects"]["prnu"] /= times
    for section, names in (
        (own["lens_defects"], ("axis_column_px", "axis_row_px", "defocus_px")),
        (own["axis_defects"]["theta_r"], ("sag_px", "wobble_px")),
    ):
        section |= {name: section[name] / times for name in names}
    return own


def _rig(rig: Rig, seed: int, corrections: Corrections) -> Rig:
    own = drawn_defects(rig, seed, BINNING)
    if corrections.response:
        own["camera_defects"]["nonlinearity"] = _CALIBRATED_NONLINEARITY
    if corrections.zero:
        own["axis_defects"]["theta_r"]["zero_deg"] = _CALIBRATED_ZERO_DEG
    lines = dict(corrections.lines)
    camera = rig.camera
    if corrections.dark_patch:
        lines |= {"stray_light": 0.0, "u_stray_light": 0.0}
        camera = camera.model_copy(update={"dark_patch": _DARK_PATCH})
    return rig.model_copy(
        update={
            "simulation": Simulation.model_validate(own),
            "uncertainty": rig.uncertainty.model_copy(update=lines),
            "camera": camera,
        }
    )


def certified_factor(tile: SimulatedTile, theta_i_deg: FloatArray, dphi_deg: float) -> FloatArray:
    """Return the radiance factor of the tile when it was new, as `SimulatedTile` states it.

    Seen at `TILE_VIEW_DEG`, at incidences (N,) in degrees.
    """
    cos_i, cos_r = np.cos(np.radians(theta_i_deg)), np.cos(np.radians(TILE_VIEW_DEG))
    across = (1 - cos_i**2) * (1 - cos_r**2) * (1 - np.cos(np.radians(dphi_deg))) / 2
    return np.asarray(
        tile.at_normal * (1 - tile.falloff * (2 - cos_i - cos_r) + tile.forward * across)
    )


def _tabled(tile: SimulatedTile) -> WhiteTile:
    """The tile with its table, which is exact: the error of a certificate is no correction's."""
    theta_i, dphi = np.array(INCIDENCES_DEG), np.array([0.0, 180.0])
    beta = np.stack([certified_factor(tile, theta_i, turn) for turn in dphi.tolist()], axis=-1)
    values = TileTable(
        axes_deg=(theta_i, np.array([TILE_VIEW_DEG]), dphi),
        beta=beta[:, np.newaxis, :],
        u_beta=np.full((theta_i.size, 1, dphi.size), 0.001),
        u_common=np.full((theta_i.size, 1, dphi.size), 0.003),
    )
    return WhiteTile(table="tile.csv", theta_r_deg=TILE_VIEW_DEG, frames=4).with_values(values)


def _one_number(tile: SimulatedTile) -> WhiteTile:
    """The tile with one number, that of 45 degrees, for all incidences."""
    number = float(certified_factor(tile, np.array([45.0]), 0.0)[0])
    return WhiteTile(
        reflectance=number, u_reflectance=0.005, certificate="45/0",
        theta_r_deg=TILE_VIEW_DEG, frames=4,
    )  # fmt: skip
