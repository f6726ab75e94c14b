"""Window methods: exact coverage keeps its specification, at a bounded cost in crops."""

from __future__ import annotations

import pytest

from acquisition.benchmark.studies import window_methods
from acquisition.benchmark.studies.window_methods import (
    coverage,
    crop,
    supersampled,
    window_studies,
)
from acquisition.benchmark.window_truth import picture, shipped_camera
from tests.support.benchmark import FEW, trial_of
from tests.support.timing.cpu_time import cpu_ratio


def test_exact_coverage_is_accurate_at_every_view_angle(monkeypatch: pytest.MonkeyPatch) -> None:
    """Specified: 1e-4 of the radiance. Many points per pixel are compared below, and take long."""
    quick = [m for m in window_methods.METHODS if m.label not in ("4 × 4 points", "8 × 8 points")]
    assert len(quick) == len(window_methods.METHODS) - 2
    monkeypatch.setattr(window_methods, "METHODS", quick)
    frames, angles = window_studies(FEW)
    own = frames.scenes[1]
    assert own == "640 × 512 pixels"
    assert trial_of(frames, own, "exact coverage").error < 1e-4
    assert trial_of(frames, own, "crop").error > 1e-3
    for study in (frames, angles):
        for scene in study.scenes:
            exact = trial_of(study, scene, "exact coverage")
            assert exact.error < trial_of(study, scene, "mask").error
    assert trial_of(angles, angles.scenes[0], "exact coverage").error < 1e-5


def test_cost_of_exact_coverage() -> None:
    """Measured with 640 x 512 pixels: 10 to 20 crops, a fifth of 4 x 4 points per pixel."""
    camera = shipped_camera()
    image = picture(40.0, camera)

    def exact() -> None:
        coverage(image, 40.0, camera)

    assert cpu_ratio(exact, lambda: crop(image, 40.0, camera), 12) < 60
    assert cpu_ratio(exact, lambda: supersampled(image, 40.0, camera, 4), 8) < 1.5
