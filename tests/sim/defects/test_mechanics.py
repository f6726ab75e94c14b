"""Surfaces that lean or lie aside, axes that err, and a beam that bends."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from instrument.config.rig import Simulation
from instrument.config.simulated.defects import AxisDefects, BeamDefects
from instrument.geometry import FloatArray, camera_direction, lamp_direction
from instrument.pinhole import Pinhole, apply_homography
from sim.defects.mechanics import (
    SeenAngles,
    axis_error_deg,
    leaning,
    leaning_across,
    leaning_homography,
    picture_shift,
    placement,
    turned,
)
from sim.scene.render import electrons_per_s
from tests.support.scans import changed, exact_rig, simulated_scene, small_scan

ANGLES = st.builds(
    SeenAngles, theta_i=st.floats(1, 80), dphi=st.floats(-179, 179), theta_r=st.floats(-80, 80)
)
TILTS = st.floats(-5, 5)
SMALL = small_scan()


def normal(tilt_deg: float, across_deg: float) -> FloatArray:
    """Normal of a surface that leans across, in axes that lean in the camera's plane."""
    t, s = np.radians(tilt_deg), np.radians(across_deg)
    return np.array([np.sin(t) * np.cos(s), np.sin(s), np.cos(t) * np.cos(s)])


@given(angles=ANGLES, tilt=TILTS, across=TILTS)
def test_angles_are_those_from_the_normal(angles: SeenAngles, tilt: float, across: float) -> None:
    n = normal(tilt, across)
    lamp, camera = lamp_direction(angles.theta_i, angles.dphi), camera_direction(angles.theta_r)
    seen = leaning_across(leaning(angles, tilt), across)
    assert np.cos(np.radians(seen.theta_r)) == pytest.approx(camera @ n, abs=1e-12)
    assert np.cos(np.radians(seen.theta_i)) == pytest.approx(lamp @ n, abs=1e-12)
    between = lamp_direction(seen.theta_i, seen.dphi) @ camera_direction(seen.theta_r)
    assert between == pytest.approx(lamp @ camera, abs=1e-12)


@given(angles=ANGLES)
def test_a_level_surface_changes_nothing(angles: SeenAngles) -> None:
    assert leaning(angles, 0.0) is angles
    assert leaning_across(angles, 0.0) is angles
    points = np.ones((3, 2))
    assert turned(points, angles.turn_deg) is points


@given(angles=ANGLES, tilt=TILTS)
def test_to_lean_across_either_side_is_the_same_with_the_lamp_there(
    angles: SeenAngles, tilt: float
) -> None:
    one = leaning_across(angles, tilt)
    mirror = SeenAngles(theta_i=angles.theta_i, dphi=-angles.dphi, theta_r=angles.theta_r)
    other = leaning_across(mirror, -tilt)
    assert astuple(other) == pytest.approx((one.theta_i, -one.dphi, one.theta_r, -one.turn_deg))


@given(theta_r=st.floats(-80, 80), height=st.floats(-2, 2), tilt=TILTS)
def test_the_picture_of_a_leaning_surface_is_that_of_its_points(
    theta_r: float, height: float, tilt: float
) -> None:
    """Each point of it, on a level plane at that point's own height."""
    pinhole = Pinhole.of(SMALL.rig)
    c, s = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    matrix = leaning_homography(pinhole, theta_r, height, tilt)
    for x, y in ((0.0, 0.0), (20.0, -15.0), (-7.0, 25.0)):
        at = (x, y * c + height * s)
        expected = pinhole.project(at, theta_r, height * c - y * s)
        assert apply_homography(matrix, (x, y)) == pytest.approx(expected, abs=1e-7)


def test_a_level_surface_has_the_homography_of_the_pinhole() -> None:
    pinhole = Pinhole.of(SMALL.rig)
    expected = pinhole.homography(40.0, 0.3)
    assert np.array_equal(leaning_homography(pinhole, 40.0, 0.3, 0.0), expected)
    assert np.array_equal(placement(0.0, 0.0, 0.0), np.eye(3))


def centre(simulation: dict[str, object], theta_r: float = 0.0) -> tuple[float, float]:
    """Centroid of the sample's light in the picture, (column, row)."""
    rig = exact_rig(SMALL.rig)
    own = Simulation.model_validate(
        {**rig.simulation.model_dump(), "background_reflectance": 0.0, **simulation}
    )
    scene = simulated_scene(
        changed(SMALL, rig={"axes": rig.axes, "u_placement_mm": 0.0, "simulation": own}), 0.0
    )
    scene.sample = scene.sample.model_copy(
        update={"model": "lambert", "parameters": {"albedo": 0.5}, "mottling": 0.0}
    )
    scene.set_axis("theta_r", theta_r)
    light = electrons_per_s(scene).astype(np.float64)
    rows, columns = np.indices(light.shape)
    return float((light * columns).sum() / light.sum()), float((light * rows).sum() / light.sum())


def test_a_sample_that_lies_aside_is_seen_aside() -> None:
    camera = SMALL.rig.camera
    px_per_mm = camera.width_px / camera.field_width_mm
    column, row = centre({})
    moved = centre({"sample_placement": {"shift_x_mm": 2.0, "shift_y_mm": 1.0}})
    assert moved[0] - column == pytest.approx(2.0 * px_per_mm, rel=0.02)
    assert moved[1] - row == pytest.approx(-1.0 * px_per_mm, rel=0.05)


def test_a_beam_that_sags_moves_the_picture_with_its_angle() -> None:
    sag = {"axis_defects": {"theta_r": {"sag_px": 2.0}}}
    assert centre(sag) == pytest.approx(centre({}), abs=1e-6)
    for theta_r in (-60.0, 60.0):
        straight, bent = centre({}, theta_r), centre(sag, theta_r)
        assert bent[0] - straight[0] == pytest.approx(2.0 * np.sin(np.radians(theta_r)), rel=0.01)


@given(angle=st.floats(-90, 90), phase=st.floats(0, 1))
def test_errors_of_an_axis(angle: float, phase: float) -> None:
    assert axis_error_deg(angle, AxisDefects(), phase) == 0.0
    assert axis_error_deg(angle, AxisDefects(zero_deg=-0.3), phase) == -0.3
    cycle = AxisDefects(cyclic_deg=0.2)
    there, opposite = (axis_error_deg(a, cycle, phase) for a in (angle, angle + 180.0))
    assert there == pytest.approx(-opposite, abs=1e-12)
    assert abs(there) <= 0.2
    assert np.array_equal(picture_shift(angle, BeamDefects(), phase), np.eye(3))
    shift = picture_shift(angle, BeamDefects(wobble_px=0.5), phase)
    assert abs(shift[1, 2]) <= 0.5
    assert shift[0, 2] == 0.0


def test_the_zero_of_an_axis_is_in_its_true_angle() -> None:
    zero = {"axis_defects": {"dphi": {"zero_deg": 0.4}}}
    own = Simulation.model_validate({**SMALL.rig.simulation.model_dump(), **zero})
    with_zero, without = (
        simulated_scene(changed(SMALL, rig={"simulation": s})).true_deg
        for s in (own, SMALL.rig.simulation)
    )
    assert with_zero["dphi"] - without["dphi"] == pytest.approx(0.4)
    assert with_zero["theta_r"] == without["theta_r"]
