"""Radiance's materials, seen by its own rtrace under one lamp after the other."""

from __future__ import annotations

import math
import os
import re
import subprocess
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from analysis.exchange.exported import Export
from analysis.exchange.materials import radiance
from instrument.errors import InputError
from instrument.geometry import FloatArray, Geometry
from tests.support.exchange.fitted_models import explained_by, fitted
from tests.support.exchange.random_tables import random_export, relative

RANDOM = random_export(0)
_LAMP_DEG = 0.5  # diameter
_LAMPS, _VIEWS = 5, 40


def _written(export: Export, folder: Path) -> str:
    for name, content in radiance.files(export, "mine"):
        (folder / name).write_bytes(content)
    return (folder / "mine.rad").read_text()


def _package() -> Path:
    found = find_spec("pyradiance")
    if found is None or found.origin is None:
        pytest.skip("pyradiance, a development extra, is not installed")
    return Path(found.origin).parent


def _ran(package: Path, folder: Path, command: list[str], text: bytes = b"") -> bytes:
    tools = {**os.environ, "RAYPATH": f".:{package / 'lib'}"}
    program = [str(package / "bin" / command[0]), *command[1:]]
    done = subprocess.run(
        program, input=text, cwd=folder, env=tools, capture_output=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr.decode()
    assert b"warning" not in done.stderr, done.stderr.decode()
    return done.stdout


def _unit(theta: FloatArray, phi: FloatArray) -> FloatArray:
    xyz = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    return np.stack(xyz, axis=-1)


def _rotation(rng: np.random.Generator) -> FloatArray:
    """Random rotation (3, 3)."""
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return np.asarray(q * np.sign(np.linalg.det(q)))


def _scene(package: Path, folder: Path, turned: FloatArray, more: str) -> None:
    """A wide plane of the material, facing the z-axis of a rotation (3, 3), and its light."""
    corners = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]) @ turned.T
    plane = f"mine polygon plane 0 0 12 {' '.join(map(repr, corners.ravel().tolist()))}\n"
    text = (folder / "mine.rad").read_text() + plane + more
    (folder / "scene.oct").write_bytes(_ran(package, folder, ["oconv", "-"], text.encode()))


def _seen(package: Path, folder: Path, views: FloatArray, *options: str) -> FloatArray:
    """Radiance (N,) of the plane seen from the directions (N, 3)."""
    rays = [" ".join(repr(x) for x in (*v, *(-x for x in v))) for v in views.tolist()]
    command = ["rtrace", "-h", *options, "scene.oct"]
    rows = _ran(package, folder, command, "\n".join(rays).encode()).decode().split()
    return np.array(rows, dtype=np.float64).reshape(-1, 3)[:, 1]


@pytest.mark.parametrize(
    ("name", "values", "off"),
    [
        ("lambert", {"albedo": 0.7312345}, 1e-3),
        ("oren_nayar", {"sigma_deg": 35}, 0.02),
        ("torrance_sparrow", {}, 0.02),
        ("lambert+ggx", {"alpha": 0.25}, 0.02),
    ],
)
def test_rtrace_sees_the_models_brdf(
    name: str, values: dict[str, float], off: float, tmp_path: Path
) -> None:
    """Radiance over irradiance of a lamp of half a degree, all round, on tilted planes."""
    package, model = _package(), fitted(name, **values)
    _written(explained_by(model, RANDOM), tmp_path)
    rng = np.random.default_rng(4)
    solid_angle = 2 * math.pi * (1 - math.cos(math.radians(_LAMP_DEG / 2)))
    for lamp in _unit(rng.uniform(0.02, 1.2, _LAMPS), rng.uniform(0, 6.28, _LAMPS)):
        turned = _rotation(rng)
        x, y, z = (turned @ lamp).tolist()
        sun = f"void light lamp 0 0 3 1e5 1e5 1e5\nlamp source sun 0 0 4 {x} {y} {z} {_LAMP_DEG}\n"
        _scene(package, tmp_path, turned, sun)
        views = _unit(rng.uniform(0.02, 1.2, _VIEWS), rng.uniform(0, 6.28, _VIEWS))
        radiances = _seen(package, tmp_path, views @ turned.T, "-ab", "0", "-dj", "0", "-aa", "0")
        seen = radiances / (1e5 * solid_angle * lamp[2])
        expected = model.brdf(Geometry.from_directions(lamp, views))
        np.testing.assert_allclose(seen, expected, rtol=off, atol=1e-3 * np.max(expected))


def test_even_light_from_all_sides_is_reflected_as_the_model_does(tmp_path: Path) -> None:
    """Radiance's indirect light is diffuse: the sum over the hemisphere is the model's."""
    package, model = _package(), fitted("oren_nayar", albedo=0.8, sigma_deg=30)
    text = _written(explained_by(model, RANDOM), tmp_path)
    x = (np.arange(24) + 0.5) / 24
    angles = np.degrees(np.arcsin(np.sqrt(x)))
    i, r, dphi = np.meshgrid(angles, angles, (np.arange(24) + 0.5) * 7.5)
    expected = math.pi * np.mean(model.brdf(Geometry.from_degrees(theta_i=i, theta_r=r, dphi=dphi)))
    (colour,) = set(re.findall(r"^4 (\S+) \1 \1 1$", text, re.MULTILINE))
    assert float(colour) == pytest.approx(expected, rel=0.01)
    sky = "void glow sky 0 0 4 1 1 1 0\nsky source all 0 0 4 0 0 1 360\n"
    _scene(package, tmp_path, np.eye(3), sky)
    seen = _seen(package, tmp_path, np.array([[0.0, 0.0, 1.0]]), "-ab", "1", "-ad", "2000")
    assert seen[0] == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("seed", range(8))
def test_texts_of_strangers_break_no_material(seed: int, tmp_path: Path) -> None:
    export = random_export(seed)
    facts = {**export.facts, "sample": "a\nvoid plastic b 0 0 5 1 1 1 0 0\r\x00 # !rm"}
    export = explained_by(fitted("lambert"), replace(export, facts=facts))
    text = _written(export, tmp_path)
    code = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert len(code) == 4
    assert code[0] == "void plastic mine"


@pytest.mark.parametrize(
    ("export", "stem", "words"),
    [
        (relative(explained_by(fitted("lambert"), RANDOM)), "mine", "relative"),
        (RANDOM, "mine", "no model was fitted"),
        (explained_by(fitted("ggx", alpha=0.001), RANDOM), "mine", "too narrow"),
        (explained_by(fitted("lambert"), RANDOM), "my file", "without spaces"),
    ],
)
def test_what_it_cannot_hold_is_refused(export: Export, stem: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        list(radiance.files(export, stem))
