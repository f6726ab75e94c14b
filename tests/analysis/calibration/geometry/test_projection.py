"""Projection of points off a plane, against the camera of the window and against OpenCV."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from analysis.calibration.geometry.projection import Lens, on_table
from instrument.pinhole import Pinhole

LENS = Lens(
    width_px=640, height_px=512, field_width_mm=72.0, beam_length_mm=800.0, axis_column_px=325.0,
    axis_row_px=240.0, roll_deg=1.5,
)  # fmt: skip


@pytest.mark.parametrize("theta_r_deg", [-60.0, 0.0, 35.0])
@pytest.mark.parametrize("height_mm", [0.0, 1.5])
def test_without_distortion_it_is_the_camera_of_the_window(
    theta_r_deg: float, height_mm: float
) -> None:
    points = np.random.default_rng(3).uniform(-25, 25, (40, 2))
    camera = Pinhole(
        beam_length_mm=800.0, field_width_mm=72.0, width_px=640, height_px=512,
        axis_column_px=325.0, axis_row_px=240.0, roll_deg=1.5,
    )  # fmt: skip
    space = np.column_stack([points, np.full(40, height_mm)])
    own = LENS.project(space, np.full(40, theta_r_deg))
    assert own == pytest.approx(camera.project(points, theta_r_deg, height_mm), abs=1e-9)


def test_distortion_is_that_of_opencv() -> None:
    lens = replace(LENS, distortion=0.05, centre_column_px=9.0, centre_row_px=-4.0)
    assert lens.project(np.zeros((1, 3)), np.zeros(1))[0] == pytest.approx([325, 240], abs=0.05)
    points = np.random.default_rng(4).uniform(-25, 25, (40, 3))
    own = lens.project(points, np.full(40, 20.0))
    flat = (own - lens.centre_px) / lens.focal_px
    intrinsic = np.array(
        [[lens.focal_px, 0, lens.centre_px[0]], [0, lens.focal_px, lens.centre_px[1]], [0, 0, 1]]
    )
    factors = np.array([lens.k1, 0.0, 0.0, 0.0])
    ideal = cv2.undistortPoints(own.reshape(-1, 1, 2), intrinsic, factors).reshape(-1, 2)
    back, _ = cv2.projectPoints(
        np.column_stack([ideal, np.ones(40)]), np.zeros(3), np.zeros(3), intrinsic, factors
    )
    assert back.reshape(-1, 2) == pytest.approx(own, abs=1e-6)
    half = np.hypot(640, 512) / 2 / lens.focal_px
    radius = np.hypot(*ideal.T)
    assert np.hypot(*flat.T) / radius - 1 == pytest.approx(0.05 * (radius / half) ** 2, rel=1e-4)


def test_a_board_leans_turns_and_moves_as_the_words_say() -> None:
    def one(**place: float) -> list[float]:
        given = {"turn": 0.0, "x": 0.0, "lean": 0.0, "across": 0.0} | place
        return on_table(
            np.array([[10.0, 5.0]]), turn_deg=np.array([given["turn"]]),
            shift_mm=np.array([[given["x"], 0.0]]), height_mm=0.0,
            lean_deg=np.array([given["lean"]]), lean_across_deg=np.array([given["across"]]),
        )[0].tolist()  # fmt: skip

    assert one(turn=90.0, x=2.0) == pytest.approx([-3, 10, 0])
    assert one(lean=1.0)[2] == pytest.approx(-10 * np.sin(np.radians(1)))
    assert one(across=1.0)[2] == pytest.approx(-5 * np.sin(np.radians(1)))
