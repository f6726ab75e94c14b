"""Corners of a board computed from a drawn rig, without pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.calibration.geometry.corners import Corners
from analysis.calibration.geometry.parameters import NAMES, Model
from instrument.board import Board
from instrument.pinhole import Pinhole

NOMINAL = Pinhole(
    beam_length_mm=800.0, field_width_mm=72.0, width_px=640, height_px=512,
    axis_column_px=317.0, axis_row_px=257.5, roll_deg=0.4,
)  # fmt: skip
SPREADS = {
    "field_percent": 2.0, "beam_percent": 2.0, "distortion_percent": 0.5, "centre_column_px": 12.0,
    "centre_row_px": 8.0, "axis_column_px": 6.0, "axis_row_px": 6.0, "roll_deg": 1.0,
    "zero_deg": 0.3, "table_lean_deg": 0.2, "height_mm": 0.3, "lean_deg": 0.2,
    "lean_across_deg": 0.2, "y_mm": 0.3, "x_mm": 0.5, "turn_deg": 2.0, "turned_x_mm": 0.5,
    "turned_turn_deg": 2.0, "sag_px": 1.0,
    "row_sag_px": 0.3,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Drawn:
    """Truth and the corners that it gives."""

    truth: dict[str, float]
    corners: Corners


def drawn(
    seed: int, *, corner_px: float = 0.03, picture_px: float = 0.1, axis_deg: float = 0.02
) -> Drawn:
    """Return a drawn geometry and its corners with noise."""
    rng = np.random.default_rng(seed)
    angles = np.array([-60.0, -45.0, -30.0, -15.0, 0.0, 15.0, 32.0, 45.0, 60.0])
    points = Board().corners_mm()
    pictures = 2 * angles.size
    blank = Corners(
        board_mm=points,
        number=np.tile(np.arange(len(points)), pictures),
        pixels=np.zeros((pictures * len(points), 2)),
        picture=np.repeat(np.arange(pictures), len(points)),
        theta_r_deg=np.tile(angles, 2),
        turned=np.repeat([False, True], angles.size),
    )
    model = Model(blank, NOMINAL)
    vector = np.zeros(model.size)
    for number, name in enumerate(NAMES):
        vector[number] = SPREADS[name] * rng.standard_normal() + getattr(NOMINAL, name, 0.0)
    vector[NAMES.index("turned_turn_deg")] += 180.0
    spread = {"axis": axis_deg, "columns": picture_px, "rows": picture_px, "bends": 0.03,
              "print": 0.003}  # fmt: skip
    for name, own in model.groups.items():
        vector[own] = spread[name] * rng.standard_normal(own.stop - own.start)
    noise = corner_px * rng.standard_normal(blank.pixels.shape)
    seen = Corners(
        board_mm=points, number=blank.number, pixels=model.pixels(vector) + noise,
        picture=blank.picture, theta_r_deg=blank.theta_r_deg, turned=blank.turned,
    )  # fmt: skip
    return Drawn(dict(zip(NAMES, vector.tolist(), strict=False)), seen)
