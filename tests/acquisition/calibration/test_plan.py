"""Plan of a camera's calibration: exposures that the camera can take, and their time."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.calibration.plan import CalibrationPlan, nearest_s
from instrument.config.load import load_rig
from instrument.config.rig import Rig
from instrument.errors import InputError
from tests.support.paths import CONFIGS

RIGS = sorted((CONFIGS / "rigs").glob("*.yaml"))


def rig_of(path: Path) -> Rig:
    return load_rig(path)


@pytest.mark.parametrize("path", RIGS, ids=lambda p: p.stem)
def test_every_exposure_can_be_taken_and_stands_once(path: Path) -> None:
    plan = CalibrationPlan(rig=rig_of(path))
    camera = plan.rig.camera
    lit, dark = plan.lit_exposures_s(plan.expected_saturating_s()), plan.dark_exposures_s()
    for exposures in (lit, dark):
        assert exposures == sorted(set(exposures))
        assert camera.min_exposure_s <= exposures[0]
        assert exposures[-1] <= camera.max_exposure_s
        assert all(nearest_s(e, camera) == pytest.approx(e, rel=1e-5) for e in exposures)
    assert (dark[0], dark[-1]) == (camera.min_exposure_s, camera.max_exposure_s)
    assert lit[-1] > 1.1 * plan.expected_saturating_s()
    assert len(lit) > 15


def test_the_duration_is_that_of_the_frames() -> None:
    rig = rig_of(CONFIGS / "rigs" / "bench_12bit.yaml")
    few, many = (CalibrationPlan(rig=rig, frames=n).duration_s() for n in (2, 20))
    assert few < 41 < many
    longest = 16 * (rig.camera.max_exposure_s + rig.camera.frame_overhead_s)
    assert few > longest


@pytest.mark.parametrize(("exposures", "frames"), [(11, 4), (201, 4), (30, 1), (30, 65)])
def test_numbers_that_determine_nothing_are_refused(exposures: int, frames: int) -> None:
    rig = rig_of(CONFIGS / "rigs" / "bench_12bit.yaml")
    with pytest.raises(InputError, match=r"allowed: \d+ to \d+. Nothing has been measured"):
        CalibrationPlan(rig=rig, exposures=exposures, frames=frames)
