"""Pinhole camera: position and size of the image of points of the sample."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from instrument.geometry import camera_direction
from instrument.pinhole import Pinhole, apply_homography, area_per_pixel_mm2, rectangle_mm

CAMERA = Pinhole(
    beam_length_mm=800.0,
    field_width_mm=72.0,
    width_px=640,
    height_px=512,
    axis_column_px=317.0,
    axis_row_px=257.5,
    roll_deg=0.4,
)
VIEW = st.floats(-85, 85)


@given(VIEW)
def test_the_rotation_axis_always_appears_at_its_pixel(theta_r: float) -> None:
    assert CAMERA.project([0.0, 0.0], theta_r) == pytest.approx([317.0, 257.5], abs=1e-9)


def test_the_picture_shows_the_field_width_at_normal_view() -> None:
    upright = Pinhole(
        beam_length_mm=800.0,
        field_width_mm=72.0,
        width_px=640,
        height_px=512,
        axis_column_px=319.5,
        axis_row_px=255.5,
        roll_deg=0.0,
    )
    left, right = upright.project([[-36.0, 0.0], [36.0, 0.0]], 0.0)
    assert right[0] - left[0] == pytest.approx(640.0)
    assert upright.project([0.0, 10.0], 0.0)[1] < 255.5  # y is up, rows grow downwards


@given(VIEW)
def test_foreshortening_is_the_cosine_of_the_view_angle(theta_r: float) -> None:
    upright = Pinhole(
        beam_length_mm=1e6,
        field_width_mm=72.0,
        width_px=640,
        height_px=512,
        axis_column_px=319.5,
        axis_row_px=255.5,
        roll_deg=0.0,
    )  # so far away that there is no perspective
    a, b = upright.project([[-1.0, 0.0], [1.0, 0.0]], theta_r)
    across = 2 * 640 / 72 * np.cos(np.radians(theta_r))
    assert b[0] - a[0] == pytest.approx(across, rel=1e-4)


def test_the_near_side_of_a_tilted_sample_is_larger() -> None:
    # At theta_r > 0 the camera stands towards +x, so the edge at +x is the near one.
    corners = CAMERA.project(rectangle_mm(40, 40), 60.0)
    far = np.linalg.norm(corners[3] - corners[0])
    near = np.linalg.norm(corners[2] - corners[1])
    distance = 800 - np.array([20, -20]) * np.sin(np.radians(60))
    assert near / far == pytest.approx(distance[1] / distance[0], rel=2e-3)


@given(VIEW, st.floats(-15, 15), st.floats(-15, 15))
def test_a_point_lies_on_the_ray_of_its_pixel(theta_r: float, x: float, y: float) -> None:
    """The depth that the homography gives is the distance along the optical axis."""
    point = CAMERA.homography(theta_r) @ [x, y, 1.0]
    away = np.array([x, y, 0.0]) - 800 * camera_direction(theta_r)
    offset = (point[:2] / point[2] - [319.5, 255.5]) / CAMERA.focal_px
    ray = np.linalg.norm([*offset, 1.0]) * point[2]
    assert ray == pytest.approx(np.linalg.norm(away), rel=1e-9)


@given(VIEW)
def test_homography_and_its_inverse_return_the_point(theta_r: float) -> None:
    homography = CAMERA.homography(theta_r, 0.3)
    points = rectangle_mm(30, 20)
    pixels = apply_homography(homography, points)
    assert apply_homography(np.linalg.inv(homography), pixels) == pytest.approx(points, abs=1e-9)


@given(VIEW)
def test_area_per_pixel_is_that_of_a_small_square(theta_r: float) -> None:
    homography = CAMERA.homography(theta_r)
    pixel = np.array([300.0, 250.0])
    square = pixel + rectangle_mm(1e-3, 1e-3)
    x, y = apply_homography(np.linalg.inv(homography), square).T
    area = abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2
    assert area_per_pixel_mm2(homography, *pixel) * 1e-6 == pytest.approx(area, rel=1e-5)


def test_cos4_is_one_on_the_optical_axis_and_falls_as_printed() -> None:
    # 1991 equation (81): cos^4 of the angle off the axis, here with tan = offset / focal length.
    angle = np.arctan(200.0 / CAMERA.focal_px)
    assert CAMERA.cos4(319.5, 255.5) == pytest.approx(1.0)
    assert CAMERA.cos4(519.5, 255.5) == pytest.approx(np.cos(angle) ** 4, rel=1e-12)
