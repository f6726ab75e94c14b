"""`gonio grab`: a well exposed frame for aiming, with saturation marked and told."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from tests.support.command import gonio_here as gonio
from tests.support.paths import CONFIGS

BENCH = CONFIGS / "rigs" / "bench_12bit.yaml"


def test_a_frame_for_aiming(tmp_path: Path) -> None:
    common = ("grab", "--rig", BENCH, "--exposure-s", "0.03", "--theta-r-deg", "50")
    done = gonio(*common, "-o", tmp_path / "aim.png", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    drawn = cv2.imread(str(tmp_path / "aim.png"))
    assert drawn.shape == (512, 640, 3)
    coloured = np.any(drawn != drawn[..., :1], axis=2)
    assert 200 < coloured.sum() < 5000  # the window's outline and the axis
    gonio(*common, "-o", tmp_path / "aim.tiff")
    raw = cv2.imread(str(tmp_path / "aim.tiff"), cv2.IMREAD_UNCHANGED)
    assert raw.dtype == np.uint16
    assert float(raw.mean()) == pytest.approx(found["frame_mean_dn"], rel=0.01)
    assert found["window_max_dn"] <= found["frame_max_dn"] <= found["full_scale_dn"]


@pytest.mark.parametrize("written", [("-o", "aim.png"), ("--json",)])
def test_a_picture_in_the_browser_is_not_said_to_be_written(
    written: tuple[str, ...], tmp_path: Path
) -> None:
    done = gonio("grab", "--rig", BENCH, "--live", *written, cwd=tmp_path)
    assert done.returncode == 2
    assert "--live" in done.stderr
    assert "leave out" in done.stderr
    assert not list(tmp_path.iterdir())


def rig_file(folder: Path, camera: dict[str, object], defects: dict[str, object]) -> Path:
    """The bench with changes of its camera."""
    rig = yaml.safe_load(BENCH.read_text())
    rig["camera"].update(camera)
    rig["simulation"]["camera_defects"] = defects
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(rig))
    return path


@pytest.mark.parametrize(
    ("camera", "defects"),
    [
        ({}, {}),
        ({"min_exposure_s": 0.0001, "full_well_electrons": 10_000.0}, {}),
        ({"bit_depth": 8, "black_level_dn": 8.0, "read_noise_electrons": 60.0}, {}),
        ({}, {"exposures_s": [0.0005 * 2**n for n in range(12)], "reads_back": "taken"}),
    ],
)
def test_a_frame_is_exposed_by_itself(
    tmp_path: Path, camera: dict[str, object], defects: dict[str, object]
) -> None:
    rig = rig_file(tmp_path, camera, defects)
    done = gonio("grab", "--rig", rig, "-o", tmp_path / "aim.png", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    # A camera with exposures in factors of two reaches the target only roughly.
    assert 0.4 < found["window_mean_dn"] / found["full_scale_dn"] < 0.75
    assert (found["saturated_pixels"], done.stderr) == (0, "")


def test_saturation_is_marked_and_told(tmp_path: Path) -> None:
    path = tmp_path / "aim.png"
    done = gonio("grab", "--rig", BENCH, "--exposure-s", "0.5", "-o", path, "--json")
    assert done.returncode == 0
    found = json.loads(done.stdout)
    assert found["saturated_pixels"] > found["window_saturated_pixels"] > 1000
    red = np.all(cv2.imread(str(path)) == (0, 0, 255), axis=2).sum()
    assert abs(red - found["saturated_pixels"]) < 1500  # the outline is drawn over some of them
    assert f"warning: {found['saturated_pixels']:.0f} of {640 * 512} pixels" in done.stderr
    assert f"{found['window_saturated_pixels']:.0f} of them in the window" in done.stderr
    assert "a shorter --exposure-s" in done.stderr


def test_too_much_light_for_the_shortest_exposure_is_told(tmp_path: Path) -> None:
    rig = rig_file(tmp_path, {"min_exposure_s": 0.5}, {})
    done = gonio("grab", "--rig", rig, "-o", tmp_path / "aim.tiff", "--json")
    assert json.loads(done.stdout)["exposure_s"] == 0.5
    assert "it needs less light" in done.stderr


def test_a_nearly_dark_window_is_told(tmp_path: Path) -> None:
    done = gonio("grab", "--rig", BENCH, "--exposure-s", "0.0005", "-o", tmp_path / "aim.png")
    assert done.returncode == 0
    assert "warning: the window is nearly dark" in done.stderr


@pytest.mark.parametrize("exposure", ["0", "-1", "9", "nan"])
def test_an_exposure_that_the_camera_does_not_have_is_refused(
    exposure: str, tmp_path: Path
) -> None:
    out = tmp_path / "frame.tiff"
    done = gonio("grab", "--rig", BENCH, f"--exposure-s={exposure}", "-o", out)
    assert done.returncode == 2
    assert "the camera can do 0.0005 to 2 s" in done.stderr
    assert not out.exists()
