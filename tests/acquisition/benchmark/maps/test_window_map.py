"""The window's map against the measuring window."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.benchmark.maps.window_map import CAMERAS, TOLERABLE, pixels_and_bias
from acquisition.measure.window import window_at
from instrument.config.load import load_protocol
from instrument.pinhole import Pinhole
from tests.support.paths import CONFIGS


def test_pixels_and_bias_agree_with_the_measuring_window() -> None:
    for camera in CAMERAS:
        rig = load_protocol(
            CONFIGS / "protocols/demo.yaml", CONFIGS / "rigs" / f"{camera.name}.yaml"
        ).rig
        assert Pinhole.of(rig) == camera.pinhole
        for side_mm in (5.0, 20.0):
            for theta_r in (0.0, 60.0, 80.0, 88.0):
                pixels, bias = pixels_and_bias(camera.pinhole, theta_r, side_mm)
                expected = window_at(0.0, camera.pinhole, side_mm, side_mm).pixels
                # As the cosine, but for the perspective.
                shrunk = expected * np.cos(np.radians(theta_r))
                assert pixels == pytest.approx(shrunk, rel=0.01)
                assert abs(bias) < TOLERABLE
