"""Samples that vary: each place looks like an even sample with the parameters of that place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from instrument.config.load import Loaded
from instrument.config.simulated.sample import SimulatedSample, Variation
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole
from sim.scene.render import electrons_per_s
from sim.scene.variation import share_at
from tests.support.config.texts import PROTOCOL, problems
from tests.support.scans import changed, simulated_scene, small_scan

ONE = {"albedo": 0.4, "sigma_deg": 10.0}
OTHER = {"albedo": 0.8, "sigma_deg": 35.0}


def _seen(loaded: Loaded, sample: SimulatedSample, view: float) -> FloatArray:
    return electrons_per_s(simulated_scene(changed(loaded, simulated_sample=sample), 50.0, view))


@pytest.mark.parametrize("pattern", ["halves", "gradient", "patch"])
def test_a_place_looks_like_a_sample_with_its_parameters(pattern: str) -> None:
    random = np.random.default_rng(len(pattern))
    loaded, view = small_scan(), float(random.uniform(-60, 60))
    variation = Variation(pattern=pattern, parameters=OTHER, size_mm=20.0)
    plain = SimulatedSample(model="oren_nayar", parameters=ONE)
    varied = plain.model_copy(update={"variation": variation})
    found = _seen(loaded, varied, view)
    scene = simulated_scene(loaded, 50.0, view)
    camera = Pinhole.of(scene.rig)
    for point in random.uniform(-20, 20, (12, 2)):
        if np.min(np.abs(np.abs(point) - 10.0)) < 2 or abs(point[0]) < 2:
            continue  # a pixel on an edge holds both
        share = float(share_at(point, variation, loaded.protocol.sample))
        even = plain.model_copy(update={"parameters": varied.with_share(share).parameters})
        angle = scene.in_plane_angles().theta_r
        column, row = (int(n) for n in camera.project(point, angle, 0.15).round())
        expected = _seen(loaded, even, view)
        # A pixel is up to half of one away from the point: a gradient changes by 1 % a mm.
        assert found[row, column] == pytest.approx(expected[row, column], rel=0.02)


def test_an_even_sample_is_unchanged_by_a_variation_to_itself() -> None:
    loaded = small_scan()
    plain = SimulatedSample(model="oren_nayar", parameters=ONE)
    same = Variation(pattern="gradient", parameters=ONE)
    varied = plain.model_copy(update={"variation": same})
    assert _seen(loaded, varied, 30.0) == pytest.approx(_seen(loaded, plain, 30.0), rel=1e-5)


def test_a_wrong_parameter_of_a_variation_is_told_with_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = PROTOCOL + "  variation: {pattern: halves, parameters: {sigma: 3.0}}\n"
    (found,) = problems(text)
    assert "simulated_sample.variation.parameters" in found
    assert "has no parameter sigma" in found
