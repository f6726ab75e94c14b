"""`gonio show`: what is shown of a run, a fit, a table and a model, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquisition.results.facts.rendered_material import camera_noise
from analysis.models import MODELS
from instrument.config.load import load_protocol
from instrument.geometry import Geometry
from tests.support.command import finished_run
from tests.support.command import gonio_here as gonio
from tests.support.scans import TWO_MODELS, small_demo

FIT = {
    "chosen": "oren_nayar",
    "verdict": "adequate",
    "candidates": [
        {
            "model": "oren_nayar",
            "parameters": {
                "albedo": {"value": 0.7, "u": 0.01},
                "sigma_deg": {"value": 40.0, "u": 0.5},
                "per_brdf": {"value": 2.0, "u": None},
            },
        }
    ],
}


@pytest.fixture(autouse=True)
def _coarse_stereo(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analysis.rendering.shown.shown._STEREO_PX", 20)
    monkeypatch.setattr("analysis.rendering.photometric_stereo._SPIRAL", 2000)


def shown(source: object, folder: Path, *options: object) -> dict:
    done = gonio("show", source, "--out", folder / "p.png", "--size-px", 32, "--json", *options)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_model_has_a_page_with_all_its_pictures(tmp_path: Path) -> None:
    model = "oren_nayar+torrance_sparrow:albedo=0.7,sigma_deg=40,ks=0.1"
    page = tmp_path / "clay.html"
    done = gonio("show", model, "--out", page, "--size-px", 32)
    assert done.returncode == 0, done.stderr
    html = page.read_text(encoding="utf-8")
    assert html.count("data:image/png;base64,") == 2 * 3 * 4
    for name in ("scene0", "scene1", "section", "isophotes", "maps", "lobes", "cost"):
        assert html.count(f'id="{name}"') == 1
    assert "ks 0.1" in html
    assert "What Lambert’s law would cost" in " ".join(done.stdout.split())
    assert str(page) in done.stdout.replace("\n", "")


def test_a_fit_is_shown_as_it_says(tmp_path: Path) -> None:
    path = tmp_path / "fit.json"
    path.write_text(json.dumps(FIT))
    found = shown(path, tmp_path)
    assert found["model"] == "oren_nayar"
    assert found["parameters"] == {"albedo": 0.7, "sigma_deg": 40.0}
    assert found["lambert_albedo"] == 0.7
    assert found["brightness_at_60_deg"]["lambert"] == pytest.approx(0.5)
    assert found["stereo"][0]["noise"] == 0.005
    assert shown(tmp_path, tmp_path) == found  # the folder that holds it


def test_a_table_is_fitted(tmp_path: Path) -> None:
    theta_i, theta_r = (a.ravel() for a in np.meshgrid([10.0, 40.0], np.arange(-60.0, 61, 10)))
    at = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r)
    brdf = MODELS["lambert"].brdf(at, albedo=0.5)
    rows = [f"{i},{r},0,{f},{f / 200}" for i, r, f in zip(theta_i, theta_r, brdf, strict=True)]
    table = tmp_path / "t.csv"
    table.write_text("theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf\n" + "\n".join(rows))
    found = shown(table, tmp_path)
    assert found["model"] == "lambert"
    assert found["parameters"]["albedo"] == pytest.approx(0.5, rel=1e-3)


def test_a_run_is_shown_with_the_noise_of_its_camera(tmp_path: Path) -> None:
    protocol = small_demo(tmp_path, TWO_MODELS)
    run = finished_run(protocol, tmp_path / "run")
    found = shown(run, tmp_path)
    assert found["model"] == json.loads((run / "fit.json").read_text())["chosen"]
    assert found["stereo"][0]["noise"] == pytest.approx(camera_noise(load_protocol(protocol)))


def test_the_pictures_alone_are_a_png_lit_by_the_lamps_asked_for(tmp_path: Path) -> None:
    pictures = []
    for lamps in (("--lamp", "-60"), ("--lamp", "60"), ("--lamp", "60,180", "--lamp", "60,0")):
        shown("lambert:albedo=0.6", tmp_path, *lamps)
        pictures.append(cv2.imread(str(tmp_path / "p.png"))[:32, :32, 0])
    left, right, both = pictures
    assert both.shape == (32, 32)
    assert np.array_equal(left, right[:, ::-1])
    assert left[16, 2] > left[16, 29]
    assert abs(int(both[16, 2]) - int(both[16, 29])) <= 1


def test_parameters_that_are_left_out_have_their_default(tmp_path: Path) -> None:
    found = shown("oren_nayar:sigma_deg=10", tmp_path, "--noise", "1%")
    default = next(p.default for p in MODELS["oren_nayar"].parameters if p.name == "albedo")
    assert found["parameters"] == {"albedo": default, "sigma_deg": 10.0}
    assert found["stereo"][1]["noise"] == 0.01


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("oren_naya",), "did you mean oren_nayar?"),
        (("oren_nayar:sigma_deg=95",), "sigma_deg = 95"),
        (("oren_nayar:sigma=3",), "has no parameter sigma"),
        (("runs/nothing",), "runs/nothing: is not there"),
        (("lambert:albedo=0",), "reflects nothing"),
        (("lambert", "--out", "p.pdf"), "must end in .html"),
        (("lambert", "--lamp", "95"), "--lamp: 95; allowed"),
        (("lambert", "--lamp", "3,4,5"), "--lamp: 3,4,5; allowed"),
        (("lambert", "--lamp", "up"), "--lamp: "),
        (("lambert", "--size-px", "5"), "--size-px: 5; allowed: 32 to 1024"),
        (("lambert", "--noise", "60%"), "--noise: 60%; allowed"),
    ],
)
def test_what_cannot_be_shown_is_refused_with_the_reason(
    arguments: tuple[str, ...], said: str, tmp_path: Path
) -> None:
    done = gonio("show", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_fit_that_found_nothing_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "fit.json"
    for content in ({**FIT, "chosen": None}, [], {"chosen": "oren_nayar", "candidates": 3}):
        path.write_text(json.dumps(content))
        done = gonio("show", path, "--out", tmp_path / "p.html")
        assert done.returncode == 2
        assert "holds no chosen model" in done.stderr
