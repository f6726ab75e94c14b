"""Map of the measuring window: pixels and bias up to the angle at which the program flags it."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.benchmark.maps.window_map import (
    FEW_PIXELS,
    RIGS,
    TOLERABLE,
    pixels_and_bias,
    window_picture,
)
from acquisition.benchmark.window_truth import shipped_camera
from acquisition.measure.window import window_at
from instrument.config.load import load_protocol
from instrument.pinhole import Pinhole
from tests.support.benchmark import check_complete
from tests.support.paths import CONFIGS


def test_the_map_is_complete_and_its_numbers_show_where_the_window_fails() -> None:
    picture = window_picture()
    check_complete(picture)
    columns = picture.columns
    small = [
        (view, pixels)
        for rig, view, pixels in zip(
            columns["rig"], columns["theta_r_deg"], columns["pixels"], strict=True
        )
        if rig == "paper_1995, 5 mm"
    ]
    few = [float(view) for view, pixels in small if float(pixels) < FEW_PIXELS]
    # 512 pixels on 90 mm: 5 mm are 809 of them, and 100 are left at acos(100/809) = 83 degrees.
    assert min(few) == pytest.approx(np.degrees(np.arccos(100 / 809)), abs=0.5)
    assert [view for view, _ in small if float(view) >= min(few)] == few


@pytest.mark.parametrize("name", RIGS)
def test_pixels_fall_as_the_cosine_and_the_bias_stays_tolerable(name: str) -> None:
    rig = load_protocol(CONFIGS / "protocols/demo.yaml", CONFIGS / "rigs" / f"{name}.yaml").rig
    camera = shipped_camera(name)
    assert Pinhole.of(rig) == camera
    for side_mm in (5.0, 20.0):
        for theta_r in (0.0, 60.0, 80.0, 88.0):
            pixels, bias = pixels_and_bias(camera, theta_r, side_mm)
            expected = window_at(0.0, camera, side_mm, side_mm).pixels
            # As the cosine, but for the perspective.
            shrunk = expected * np.cos(np.radians(theta_r))
            assert pixels == pytest.approx(shrunk, rel=0.01)
            assert abs(bias) < TOLERABLE
