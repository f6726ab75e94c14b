"""Search for an exposure: found within 1 % whatever the response, or the end of the range."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.calibration.exposure_search import exposure_reaching, share_of_scale
from instrument.config.load import load_rig
from tests.support.paths import CONFIGS

CAMERA = load_rig(CONFIGS / "rigs" / "bench_12bit.yaml").camera


def test_random_lights_and_gammas_reach_the_share() -> None:
    rng = np.random.default_rng(3)
    for _ in range(100):
        full_s, gamma, share = 10 ** rng.uniform(-2.5, 0), rng.uniform(1, 2.4), rng.uniform(0.2, 1)

        def level(e: float, full: float = full_s, gamma: float = gamma) -> float:
            return float(min(e / full, 1.0) ** (1 / gamma))

        found = exposure_reaching(share, level, CAMERA)
        expected = max(full_s * share**gamma, CAMERA.min_exposure_s)
        assert found == pytest.approx(expected, rel=0.05)


def test_the_ends_of_the_range_are_taken_where_no_exposure_reaches_the_share() -> None:
    assert exposure_reaching(0.4, lambda _: 1.0, CAMERA) == CAMERA.min_exposure_s
    assert exposure_reaching(0.4, lambda _: 0.1, CAMERA) == CAMERA.max_exposure_s


def test_black_is_no_light_and_full_scale_is_all() -> None:
    assert share_of_scale(CAMERA.black_level_dn, CAMERA) == 0
    assert share_of_scale(0.98 * CAMERA.max_dn, CAMERA) == pytest.approx(1)
