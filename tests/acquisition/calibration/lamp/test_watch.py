"""`gonio calibrate lamp`: finds the defects of a simulated lamp, refuses what tells nothing."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from acquisition.rig import OpenRig
from instrument.calibration.camera_file import read_camera_file, write_camera_file
from instrument.calibration.lamp_file import read_lamp_file
from instrument.config.simulated.defects import LampDefects
from sim.defects.lamp import beam_profile
from tests.support.command import gonio_here as gonio
from tests.support.paths import CONFIGS

BENCH = CONFIGS / "rigs" / "bench_12bit.yaml"


def rig_file(folder: Path, white: float = 6e5, drift: float = 0.0, **lamp: Any) -> Path:
    """A rig with a quarter of the pixels a side, and a lamp with defects."""
    rig = yaml.safe_load(BENCH.read_text())
    for key in ("width_px", "height_px", "axis_row_px", "axis_column_px"):
        rig["camera"][key] = type(rig["camera"][key])(rig["camera"][key] / 4)
    rig["lamp"]["white_electrons_per_s"], rig["swap_s"] = white, 0.0
    rig["simulation"] |= {"lamp_defects": lamp, "lamp_drift_per_hour": drift}
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(rig))
    return path


def calibrated(folder: Path, rig: Path, *options: object) -> dict[str, Any]:
    done = gonio("calibrate", "lamp", "--rig", rig, "-o", folder / "l.npz", "--json", *options)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def value_and_u(found: dict[str, Any], key: str) -> tuple[float, float]:
    return found["quantities"][key]["value"], found["quantities"][key]["u"]


def test_a_warm_up_and_a_flicker_are_found_and_the_watch_ends_by_itself(tmp_path: Path) -> None:
    rig = rig_file(tmp_path, warm_up=0.05, warm_up_s=120.0, flicker=0.001, drift=0.006)
    found = calibrated(tmp_path, rig, "--minutes", 25)
    read = read_lamp_file(tmp_path / "l.npz")
    end_s = float(read.arrays["readings"][-1, 0])
    # The watch begins some seconds after the simulated lamp: when it has found its exposure.
    late = float(np.exp(-3 / 120))
    left = 0.05 * late * np.exp(-end_s / 120)
    truth = {
        "warm_up_percent": 5.0 * late,
        "warm_up_s": 120.0,
        "drift_percent_per_hour": 0.6,
        "change_percent": 0.1 + 100 * left * (1 - np.exp(-600 / 120)),
        "flicker_percent": 0.1,
        "steady_s": 120 * np.log(0.05 * late * (1 - np.exp(-5)) / 0.001),
    }
    for key, true in truth.items():
        value, u = value_and_u(found, key)
        assert value == pytest.approx(true, abs=4 * u + 0.02 * abs(true)), key
        assert 0 < u < 0.5 * true, key
    assert found["steady"]
    assert truth["steady_s"] < end_s < 25 * 60 - 10
    assert (read.sha256, read.steady, read.rig) == (found["sha256"], True, "bench_12bit")
    assert "proposed for the rig file: lamp: {u_flicker: 0.0011}" in found["notes"][1]
    assert found["quantities"]["every_points"]["value"] >= 100


def test_a_steady_lamp_is_told_steady_at_once_and_in_words(tmp_path: Path) -> None:
    done = gonio("calibrate", "lamp", "--rig", rig_file(tmp_path), "-o", tmp_path / "l.npz")
    assert done.returncode == 0, done.stderr
    assert "the lamp is steady, from the start of the watch" in done.stdout
    assert "its time constant unknown" in " ".join(done.stdout.split())
    readings = read_lamp_file(tmp_path / "l.npz").arrays["readings"]
    assert readings[-1, 0] == pytest.approx(120, abs=1)  # a fifth of the time that is foretold
    assert "2 min 00 s: the light changes" not in done.stderr  # lines grow rarer
    assert "1 min 30 s: the light changes by" in done.stderr


def test_a_lamp_that_is_not_steady_is_said_to_be_so(tmp_path: Path) -> None:
    rig = rig_file(tmp_path, warm_up=0.1, warm_up_s=200.0)
    found = calibrated(tmp_path, rig, "--minutes", 5)
    assert not found["steady"]
    assert "was not steady after 5 min 00 s" in found["notes"][0]
    assert re.search(r"By the fit it is steady 1\d min \d\d s after the start", found["notes"][0])


def test_the_map_is_the_beam_of_the_lamp(tmp_path: Path) -> None:
    spot = {"spot_fwhm_mm": 130.0, "aim_x_mm": 5.0, "aim_y_mm": -3.0}
    found = calibrated(tmp_path, rig_file(tmp_path, **spot), "--theta-i-deg", 45)
    light = found["light_map"]
    x, y = (g.ravel() for g in np.meshgrid(*2 * [np.linspace(-10, 10, 21)]))
    half = light["half_mm"]
    terms = zip(light["exponents"], light["coefficients"], strict=True)
    mapped = sum(c * (x / half) ** i * (y / half) ** j for (i, j), c in terms)
    points = np.column_stack([x, y, np.zeros(x.size)])
    profile = beam_profile(points, 45.0, 0.0, LampDefects.model_validate(spot))
    centre = beam_profile(np.zeros((1, 3)), 45.0, 0.0, LampDefects.model_validate(spot))
    assert mapped == pytest.approx(profile / centre, abs=1.5e-3)
    value, u = value_and_u(found, "peak_to_valley_percent")
    assert value == pytest.approx(100 * np.ptp(profile) / centre[0], abs=0.15)
    assert 0 < u < 0.1


def test_no_axis_is_opened_and_the_plan_opens_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(self: OpenRig, name: str = "") -> None:
        raise AssertionError(name)

    monkeypatch.setattr(OpenRig, "axis", refuse)
    rig = rig_file(tmp_path)
    calibrated(tmp_path, rig)
    monkeypatch.setattr(OpenRig, "camera", refuse)
    done = gonio("calibrate", "lamp", "--rig", rig, "--plan", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "4 frames every 10 s" in done.stdout
    assert sorted(p.name for p in tmp_path.iterdir()) == ["l.npz", "rig.yaml"]


@pytest.mark.parametrize(
    ("fault", "white", "code", "words"),
    [
        ("world lamp 0 at camera.grab 1", 6e5, 5, "no light on the tile: the window shows"),
        ("", 500.0, 5, "no light on the tile"),
        ("world shutter_shut 1 at camera.grab 1", 6e5, 5, "the darks are not dark: the window"),
        ("", 1e9, 5, "of the window's pixels are saturated at 0.0005 s"),
        ("world lamp 3 at camera.grab 20", 6e5, 5, "saturated"),
        ("world lamp 0 at camera.grab 20", 6e5, 3, r"lamp: went out \d+ s after the start"),
        ("world lamp 0.95 at camera.grab 20", 6e5, 3, r"its light jumped by -5\.?\d* % between"),
        ("camera is unplugged at camera.grab 20", 6e5, 3, "camera"),
    ],
    ids=["off", "dim", "leak", "bright", "grows", "dies", "jumps", "camera"],
)
def test_what_tells_nothing_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str, white: float, code: int, words: str
) -> None:
    monkeypatch.setenv("GONIO_FAULTS", fault)
    rig = rig_file(tmp_path, white)
    done = gonio("calibrate", "lamp", "--rig", rig, "-o", tmp_path / "l.npz")
    assert (done.returncode, done.stdout) == (code, ""), done.stderr
    assert re.search(words, " ".join(done.stderr.split())), done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rig.yaml"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("-o", "l.npz"), "name the rig file: --rig FILE"),
        (("--rig", BENCH), "gonio calibrate lamp: name the file to write: -o FILE.npz"),
        (("--rig", BENCH, "-o", "there.npz"), "there.npz: exists already"),
        (("--rig", BENCH, "-o", "l.npz", "--minutes", "1"), "--minutes 1 is too short"),
    ],
)
def test_wrong_input_ends_before_anything_is_measured(
    tmp_path: Path, options: tuple[object, ...], words: str
) -> None:
    (tmp_path / "there.npz").write_text("")
    done = gonio("calibrate", "lamp", *options, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["there.npz"]


def test_a_gamma_that_the_rig_s_calibration_knows_is_taken_out(tmp_path: Path) -> None:
    """Without it the warm-up looks smaller by the gamma; another camera's is refused."""
    rig = rig_file(tmp_path, warm_up=0.05, warm_up_s=60.0)
    own = yaml.safe_load(rig.read_text())
    own["simulation"]["camera_defects"] = {"gamma": 2.2}
    rig.write_text(yaml.safe_dump(own))
    short = ("--minutes", 4, "--within-minutes", 2)
    bare = value_and_u(calibrated(tmp_path, rig, *short), "warm_up_percent")
    quick = ("--exposures", "18", "--frames", "2")
    done = gonio("calibrate", "camera", "--rig", rig, "-o", tmp_path / "c.npz", *quick)
    assert done.returncode == 0, done.stderr
    own["camera"]["calibration"] = "c.npz"
    rig.write_text(yaml.safe_dump(own))
    (tmp_path / "l.npz").unlink()
    value, u = value_and_u(calibrated(tmp_path, rig, *short), "warm_up_percent")
    late = 100 * 0.05 * float(np.exp(-2 / 60))
    assert value == pytest.approx(late, abs=4 * u + 0.03 * late)
    assert value / bare[0] == pytest.approx(2.2, rel=0.1)
    other = replace(read_camera_file(tmp_path / "c.npz"), camera="Other camera 7")
    write_camera_file(tmp_path / "c.npz", other)
    done = gonio("calibrate", "lamp", "--rig", rig, "-o", tmp_path / "m.npz")
    assert (done.returncode, done.stdout) == (2, "")
    assert "c.npz: is the calibration of 'Other camera 7'" in done.stderr
    assert not (tmp_path / "m.npz").exists()
