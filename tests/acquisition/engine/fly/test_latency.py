"""Latency between camera and axis: found from a turn there and back, with a u that holds."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.engine.fly.latency import Course, fit_latency
from instrument.errors import DeviceError


def courses(
    random: np.random.Generator, tau_s: float, noise: float, depth: float = 1.0
) -> tuple[Course, Course]:
    """Area of a sample that is foreshortened, seen at a random speed in both directions."""
    start, speed = float(random.uniform(40.0, 60.0)), float(random.uniform(3.0, 30.0))
    nominal = start + np.linspace(0.0, 25.0, int(random.integers(10, 25)))
    found = []
    for angles, signed in ((nominal, speed), (nominal[::-1], -speed)):
        reported = angles + random.normal(0.0, 0.02, angles.size)
        area = depth * np.cos(np.radians(reported + signed * tau_s))
        found.append(Course(reported, area + random.normal(0.0, noise, angles.size), signed))
    return found[0], found[1]


def test_the_latency_is_found_within_its_u() -> None:
    random, pulls = np.random.default_rng(17), []
    for _ in range(200):
        tau_s = float(random.uniform(-0.04, 0.04))
        found = fit_latency(*courses(random, tau_s, noise=2e-4))
        pulls.append((found.value_s - tau_s) / found.u_s)
    assert abs(np.mean(pulls)) < 0.25
    assert 0.4 < np.std(pulls) < 1.2  # u counts half of the residuals, which here are independent
    assert np.max(np.abs(pulls)) < 5


def test_the_scatter_of_an_angle_is_that_of_the_feature_over_its_slope() -> None:
    random = np.random.default_rng(18)
    found = [fit_latency(*courses(random, 0.01, noise=2e-4)).u_angle_deg for _ in range(50)]
    slope = np.sin(np.radians(62.0)) * np.radians(1.0)  # in the middle of a usual span
    assert np.median(found) == pytest.approx(np.sqrt(2) * 2e-4 / slope, rel=0.25)


def test_frames_that_are_missing_on_one_way_are_left_out() -> None:
    there, back = courses(np.random.default_rng(19), 0.02, noise=1e-4)
    fewer = Course(back.angles_deg[2:], back.feature[2:], back.speed_deg_per_s)
    found = fit_latency(there, fewer)
    assert found.frames == 2 * (there.angles_deg.size - 2)
    assert abs(found.value_s - 0.02) < 5 * found.u_s


def test_a_picture_without_a_feature_is_refused() -> None:
    with pytest.raises(DeviceError, match="does not change enough"):
        fit_latency(*courses(np.random.default_rng(20), 0.0, noise=1e-3, depth=0.0))
    there, back = courses(np.random.default_rng(21), 0.0, noise=1e-4)
    with pytest.raises(DeviceError, match="pairs of frames"):
        fit_latency(there, Course(back.angles_deg[:4], back.feature[:4], back.speed_deg_per_s))
