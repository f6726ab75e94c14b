"""Mitsuba's materials, loaded by Mitsuba 3: it has the BRDF of the model."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from analysis.exchange.exported import Export
from analysis.exchange.materials import mitsuba
from instrument.errors import InputError
from instrument.geometry import FloatArray, Geometry
from tests.support.exchange.fitted_models import explained_by, fitted
from tests.support.exchange.random_tables import random_export, relative

RANDOM = random_export(0)


def _written(export: Export, folder: Path) -> Path:
    for name, content in mitsuba.files(export, "mine"):
        (folder / name).write_bytes(content)
    return folder / "mine.xml"


def _renderer(variant: str) -> Any:
    renderer = pytest.importorskip("mitsuba", reason="Mitsuba 3 is not installed")
    renderer.set_variant(variant)
    return renderer


def _brdf_of(renderer: Any, material: Any) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """BRDF (3,) or (4,) in 1/sr of a material for unit vectors to lamp and camera."""

    def brdf(to_lamp: FloatArray, to_camera: FloatArray) -> FloatArray:
        there = renderer.SurfaceInteraction3f()
        there.wi = renderer.Vector3f(*to_lamp)
        if "spectral" in renderer.variant():
            there.wavelengths = [400.0, 500.0, 600.0, 700.0]
        seen = material.eval(renderer.BSDFContext(), there, renderer.Vector3f(*to_camera))
        return np.array(seen).reshape(-1) / to_camera[2]

    return brdf


def _directions(seed: int, number: int) -> list[tuple[FloatArray, FloatArray]]:
    """Pairs of unit vectors to lamp and camera, up to 70 degrees from the normal, all round."""
    rng = np.random.default_rng(seed)
    theta, phi = np.radians(rng.uniform(1, 70, (2, number))), rng.uniform(0, 2 * np.pi, (2, number))
    xyz = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    lamp, camera = np.stack(xyz, axis=-1)
    return list(zip(lamp, camera, strict=True))


@pytest.mark.parametrize("variant", ["scalar_rgb", "scalar_spectral"])
@pytest.mark.parametrize(
    ("name", "values", "off"),
    [
        ("lambert", {"albedo": 0.7312345}, 1e-6),
        ("oren_nayar", {"sigma_deg": 35}, 0.01),
        ("torrance_sparrow", {}, 0.02),
        ("lambert+ggx", {"alpha": 0.25}, 0.02),
    ],
)
def test_mitsuba_has_the_models_brdf(
    name: str, values: dict[str, float], off: float, variant: str, tmp_path: Path
) -> None:
    renderer, model = _renderer(variant), fitted(name, **values)
    path = _written(explained_by(model, RANDOM), tmp_path)
    table = f"mine_{variant.removeprefix('scalar_')}.bsdf"
    material = renderer.load_file(str(path), **({} if name == "lambert" else {"table": table}))
    brdf = _brdf_of(renderer, material)
    for to_lamp, to_camera in _directions(1, 60):
        expected = float(model.brdf(Geometry.from_directions(to_lamp, to_camera)))
        assert brdf(to_lamp, to_camera) == pytest.approx(expected, rel=off)


def test_mitsuba_samples_directions_with_the_density_that_it_states(tmp_path: Path) -> None:
    """Mean weight of sampled directions: the reflectance of a hemisphere."""
    renderer, model = _renderer("scalar_rgb"), fitted("oren_nayar", albedo=0.8, sigma_deg=30)
    path = _written(explained_by(model, RANDOM), tmp_path)
    material = renderer.load_file(str(path), table="mine_rgb.bsdf")
    there = renderer.SurfaceInteraction3f()
    there.wi = renderer.Vector3f(0.5, 0, np.sqrt(0.75))
    rng, weights = np.random.default_rng(2), []
    for one, two, three in rng.uniform(size=(2000, 3)).tolist():
        weights.append(
            material.sample(renderer.BSDFContext(), there, one, renderer.Point2f(two, three))[1][0]
        )
    theta, phi = np.meshgrid(np.arange(0.5, 90), np.arange(0.5, 360))
    seen = Geometry.from_degrees(theta_i=30, theta_r=theta, dphi=phi)
    strips = np.sin(seen.theta_r) * np.cos(seen.theta_r) * np.radians(1) ** 2
    assert np.mean(weights) == pytest.approx(np.sum(model.brdf(seen) * strips), rel=0.02)


@pytest.mark.parametrize("seed", range(8))
def test_texts_of_strangers_break_no_material(seed: int) -> None:
    export = random_export(seed)
    facts = {**export.facts, "sample": '--> <&"\x00 -- ---', "notes": "ends in -"}
    model = fitted("lambert")
    export = explained_by(model, replace(export, facts=facts))
    ((name, content),) = mitsuba.files(export, "a--b")
    assert name == "a--b.xml"
    assert ElementTree.fromstring(content).get("type") == "diffuse"


def test_the_side_file_says_that_the_table_is_modelled(tmp_path: Path) -> None:
    _written(explained_by(fitted("oren_nayar"), random_export(5)), tmp_path)
    side = json.loads((tmp_path / "mine.mitsuba.json").read_text())
    assert side["origin"] == "modelled"
    assert side["relative_deviation_of_the_table"]["of_95_percent"] < 0.01
    assert side["nodes"]["model_not_valid"] > 0


@pytest.mark.parametrize(
    ("export", "words"),
    [
        (relative(explained_by(fitted("lambert"), RANDOM)), "relative"),
        (RANDOM, "no model was fitted"),
        (explained_by(fitted("ggx", alpha=0.001), RANDOM), "too narrow"),
    ],
)
def test_what_it_cannot_hold_is_refused(export: Export, words: str) -> None:
    with pytest.raises(InputError, match=words):
        list(mitsuba.files(export, "mine"))
