"""Shift of a plate by the markers on it, in pictures of the simulated rig."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.measure.plate.markers import plate_shift
from instrument.config.load import Loaded
from instrument.config.protocol import Markers
from instrument.pinhole import Pinhole
from tests.support.plates import MARKERS, picture, with_plate
from tests.support.scans import small_scan


@pytest.fixture(scope="module")
def scan() -> Loaded:
    return small_scan(shrink=1)


@pytest.mark.parametrize("seed", range(12))
def test_a_plate_is_found_where_it_lies(seed: int, scan: Loaded) -> None:
    """Within 0.05 mm, at view angles up to 75 degrees; its height shifts it by -h tan(theta_r)."""
    random = np.random.default_rng(seed)
    x, y = random.uniform(-2.0, 2.0, 2)
    turn, height = random.uniform(-3.0, 3.0), random.uniform(-0.3, 0.3)
    theta_r = random.uniform(-75.0, 75.0)
    loaded = with_plate(scan, x, y, turn, height)
    image = picture(loaded, theta_r, random)
    found = plate_shift(image, theta_r, Pinhole.of(loaded.rig), MARKERS)
    assert found is not None
    seen_x = x - height * np.tan(np.radians(theta_r))
    assert found.x_mm == pytest.approx(seen_x, abs=0.05)
    assert found.y_mm == pytest.approx(y, abs=0.05)
    assert found.markers >= 2
    assert found.turn_deg == pytest.approx(turn, abs=0.15)


def test_paper_brighter_than_full_scale_is_no_hindrance(scan: Loaded) -> None:
    """The exposure suits a dark sample, beside which white paper is saturated."""
    loaded = with_plate(scan, 1.0, -0.5, 0.0)
    image = picture(loaded, 40.0, np.random.default_rng(0), paper=3.0)
    found = plate_shift(image, 40.0, Pinhole.of(loaded.rig), MARKERS)
    assert found is not None
    assert (found.x_mm, found.y_mm) == pytest.approx((1.0, -0.5), abs=0.05)


def test_of_a_single_marker_the_turn_is_the_one_known(scan: Loaded) -> None:
    loaded = with_plate(scan, 0.7, 0.3, 2.0)
    one = MARKERS.model_copy(update={"centres_mm": MARKERS.centres_mm[:1]})
    image = picture(loaded, 20.0, np.random.default_rng(1))
    pinhole = Pinhole.of(loaded.rig)
    found = plate_shift(image, 20.0, pinhole, one, turn_deg=2.0)
    unknown = plate_shift(image, 20.0, pinhole, one)
    assert found is not None
    assert unknown is not None
    assert (found.x_mm, found.y_mm) == pytest.approx((0.7, 0.3), abs=0.05)
    assert abs(unknown.y_mm - 0.3) > 0.5


def no_markers(image: NDArray[Any], _: Markers) -> tuple[NDArray[Any], Markers]:
    return np.full_like(image, 300), MARKERS


def other_numbers(image: NDArray[Any], markers: Markers) -> tuple[NDArray[Any], Markers]:
    """Marker 0 where 1 is expected, and so on."""
    centres = markers.centres_mm
    return image, markers.model_copy(update={"centres_mm": [*centres[1:], centres[0]]})


def beyond_the_picture(image: NDArray[Any], markers: Markers) -> tuple[NDArray[Any], Markers]:
    return image, markers.model_copy(update={"centres_mm": [[400.0, 0.0], [0.0, -400.0]]})


def noise_alone(image: NDArray[Any], markers: Markers) -> tuple[NDArray[Any], Markers]:
    random = np.random.default_rng(3)
    return random.integers(0, 4095, image.shape).astype(image.dtype), markers


@pytest.mark.parametrize("change", [no_markers, other_numbers, beyond_the_picture, noise_alone])
def test_what_is_no_such_marker_is_not_seen(change: Any, scan: Loaded) -> None:
    loaded = with_plate(scan, 0.0, 0.0, 0.0)
    image, markers = change(picture(loaded, 10.0, np.random.default_rng(2)), MARKERS)
    assert plate_shift(image, 10.0, Pinhole.of(loaded.rig), markers) is None
