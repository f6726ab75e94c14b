"""Exposure ladder: powers of sqrt 2 within the camera's range."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from acquisition.plan.exposure_ladder import (
    exposure_ladder_s,
    longest_exposure_s,
    longest_exposures_s,
)
from instrument.config.load import Loaded


def test_exposures_come_from_one_ladder_within_the_cameras_range(demo: Loaded) -> None:
    camera = demo.rig.camera
    ladder = exposure_ladder_s(camera)
    assert ladder[0] == camera.min_exposure_s
    assert ladder[-1] <= camera.max_exposure_s
    assert all(b / a == pytest.approx(2**0.5, rel=1e-5) for a, b in pairwise(ladder))
    assert all(longest_exposure_s(exposure, camera) == exposure for exposure in ladder)
    assert longest_exposure_s(1e-9, camera) == ladder[0]


def test_many_exposures_are_those_of_one_after_the_other(demo: Loaded) -> None:
    camera = demo.rig.camera
    ladder = np.array(exposure_ladder_s(camera))
    limits = np.random.default_rng(4).uniform(0, 2 * ladder[-1], 50)
    for some in (limits, ladder, ladder * (1 - 1e-8)):
        one_by_one = [longest_exposure_s(limit, camera) for limit in some.tolist()]
        assert longest_exposures_s(some, camera).tolist() == one_by_one
