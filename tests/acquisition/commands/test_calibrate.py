"""`gonio calibrate camera`: finds the defects of a simulated camera, refuses what tells nothing."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from instrument.calibration.camera_file import read_camera_file
from tests.support.command import gonio_here as gonio
from tests.support.paths import CONFIGS

BENCH, PAPER = (CONFIGS / "rigs" / f"{name}.yaml" for name in ("bench_12bit", "paper_1995"))
HOT = ((20, 30), (80, 110), (81, 110))
QUICK = ("--exposures", "18", "--frames", "2")


def rig_file(
    folder: Path, defects: dict[str, Any] | None = None, base: Path = BENCH, **camera: Any
) -> Path:
    """A rig with a fifth of the pixels a side, its camera changed."""
    rig = yaml.safe_load(base.read_text())
    for key in ("width_px", "height_px", "axis_row_px", "axis_column_px"):
        rig["camera"][key] = type(rig["camera"][key])(rig["camera"][key] / 5)
    for key, value in camera.items():
        place = rig["lamp"] if key in rig["lamp"] else rig["camera"]
        place[key] = value
    rig["simulation"]["camera_defects"] = defects or {}
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(rig))
    return path


def calibrated(folder: Path, rig: Path, *options: object) -> dict[str, Any]:
    done = gonio(
        "calibrate", "camera", "--rig", rig, "-o", folder / "c.npz", "--json", *QUICK, *options
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_every_defect_of_a_camera_is_found_within_its_u(tmp_path: Path) -> None:
    hot = [{"row": r, "column": c, "electrons_per_s": 5e3} for r, c in HOT]
    defects = {"nonlinearity": 0.01, "prnu": 0.008, "dsnu_electrons": 6.0, "hot_pixels": hot}
    found = calibrated(tmp_path, rig_file(tmp_path, defects))
    truth = {
        "gain_dn_per_electron": (4095 - 64) / 30_000,
        "dark_noise_electrons": 8.0,
        "dark_current_electrons_per_s": 20.0,
        "full_well_electrons": 30_000.0,
        "dark_dn": 64.0,
        "nonlinearity_percent": 0.9,  # of 1 % between 0 and full scale, from 5 to 95 %
        "prnu_percent": 0.8,
        "dsnu_electrons": 6.0,
    }
    for key, true in truth.items():
        value, u = (found["quantities"][key][part] for part in ("value", "u"))
        # A drawn pattern of pixels has not quite the spread and the mean that were asked for.
        wander = 0.02 * true if key.startswith(("prnu", "dsnu", "nonlin")) else 3e-4 * true
        assert value == pytest.approx(true, abs=4 * u + wander), key
        assert u < 0.03 * true, key
    assert found["quantities"]["hot_pixels"]["value"] == 3
    assert found["response"]["name"] == "residual non-linearity"
    read = read_camera_file(tmp_path / "c.npz")
    assert read.sha256 == found["sha256"]
    assert {tuple(p) for p in np.argwhere(read.arrays["hot"]).tolist()} == set(HOT)
    share = np.linspace(0.1, 0.9, 9)
    counts = 64 + (4095 - 64) * (share + 0.01 * share * (1 - share))
    light = (read.linear_counts_dn(counts) - 64) / share
    assert np.ptp(light) / light.mean() < 1e-3


def test_a_gamma_that_was_left_on_is_named(tmp_path: Path) -> None:
    done = gonio(
        "calibrate", "camera", "--rig", rig_file(tmp_path, {"gamma": 2.2}),
        "-o", tmp_path / "c.npz", *QUICK,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    words = " ".join(done.stdout.split())
    assert "full scale: gamma 2.2; u of light" in words
    assert "the camera's response is a gamma 2.2: switch it off in the camera" in words
    assert "dark noise sigma_d unknown 8" in words
    assert "e- 30000" in words  # the rig file's full well, beside the measured one
    assert max(map(len, done.stdout.splitlines()[:-1])) <= 80  # the last line names the file


def test_a_lamp_covered_by_hand_and_8_bit(tmp_path: Path) -> None:
    found = calibrated(tmp_path, rig_file(tmp_path, base=PAPER))
    noise = found["quantities"]["dark_noise_electrons"]
    assert noise["value"] == pytest.approx(60.0, abs=4 * noise["u"])
    gain = found["quantities"]["gain_dn_per_electron"]
    assert gain["value"] == pytest.approx((255 - 8) / 60_000, abs=4 * gain["u"])
    assert any("less than rounding to counts" in note for note in found["notes"])


def test_a_rig_file_that_states_another_well_is_told(tmp_path: Path) -> None:
    """The amplifier has twice the gain of the rig file: so has the well that full scale means."""
    rig = rig_file(tmp_path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GONIO_FAULTS", "world amplifier 2 at camera.grab 1")
        found = calibrated(tmp_path, rig)
    (note,) = found["notes"]
    assert "full_well_electrons 30000 does not fit the measured gain: 1" in note
    assert found["quantities"]["gain_dn_per_electron"]["value"] == pytest.approx(0.2687, rel=0.01)


def test_the_plan_opens_nothing_and_writes_nothing(tmp_path: Path) -> None:
    done = gonio("calibrate", "camera", "--rig", BENCH, "--plan", "--frames", "7", cwd=tmp_path)
    assert done.returncode == 0
    assert "lamp dark: 6 exposures of 0.0005 to 2 s, 7 frames each" in done.stdout
    assert "takes about" in done.stdout
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("-o", "c.npz"), "name the rig file: --rig FILE"),
        (("--rig", BENCH), "name the file to write: -o FILE.npz"),
        (("--rig", BENCH, "-o", "c.yaml"), "the file's name must end in .npz"),
        (("--rig", BENCH, "-o", "there.npz"), "there.npz: exists already"),
        (("--rig", BENCH, "-o", "no/c.npz"), "there is no folder no: make it first"),
        (("--rig", BENCH, "-o", "c.npz", "--exposures", "5"), "--exposures 5; allowed: 12 to 200"),
        (("--rig", BENCH, "-o", "c.npz", "--frames", "1"), "--frames 1; allowed: 2 to 64"),
        (("--rig", "real.yaml", "-o", "c.npz"), "standard input is no terminal"),
    ],
)
def test_wrong_input_ends_before_anything_is_measured(
    tmp_path: Path, options: tuple[object, ...], words: str
) -> None:
    (tmp_path / "there.npz").write_text("")
    real = yaml.safe_load((CONFIGS / "rigs" / "emulated.yaml").read_text())
    real["axes"] = {
        name: {"driver": "hand", "min_deg": -88.0, "max_deg": 88.0, "u_deg": 0.1}
        for name in ("theta_i", "dphi", "theta_r")
    }
    real["camera"]["device"] = "/dev/video-none"
    del real["lamp"]["shutter_s"]
    real["lamp"] |= {"driver": "manual", "darkened_by": "hand"}
    (tmp_path / "real.yaml").write_text(yaml.safe_dump(real))
    before = sorted(tmp_path.iterdir())
    done = gonio("calibrate", "camera", *options, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("fault", "rig", "words"),
    [
        ("world shutter_shut 1 at camera.grab 1", {}, "the darks are not dark.*Cover the lamp"),
        ("world shutter_shut 0.05 at camera.grab 1", {}, "the darks are not dark"),
        ("world shutter_shut 0.02 at camera.grab 1", {}, "like 2 % of the lamp's light"),
        ("", {"white_electrons_per_s": 1e9}, "pixels of the flat field are saturated at 0.0005 s"),
        ("", {"white_electrons_per_s": 2e6, "min_exposure_s": 0.012}, "are below saturation"),
        ("", {"white_electrons_per_s": 1e3}, "of full scale; needed: 50 %"),
        ("", {"fixed_exposure_s": 0.01}, "its counts do not follow the exposure"),
        ("world noise 0 at camera.grab 1", {}, "its frames have no noise"),
        ("world lamp 0.7 at camera.grab 36", {}, "the lamp's light changed by"),
    ],
    ids=[
        "lamp on", "leak", "small leak", "saturated", "few", "dim", "fixed", "denoised",
        "lamp fails",
    ],
)  # fmt: skip
def test_frames_that_tell_nothing_end_with_5_and_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str, rig: dict[str, Any], words: str
) -> None:
    monkeypatch.setenv("GONIO_FAULTS", fault)
    defects = {"fixed_exposure_s": rig.pop("fixed_exposure_s")} if "fixed_exposure_s" in rig else {}
    path = rig_file(tmp_path, defects, **rig)
    done = gonio("calibrate", "camera", "--rig", path, "-o", tmp_path / "c.npz", *QUICK)
    assert (done.returncode, done.stdout) == (5, ""), done.stderr
    assert re.search(words, " ".join(done.stderr.split())), done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rig.yaml"]


def test_an_open_shutter_ends_it_with_the_darks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GONIO_FAULTS", "world shutter_shut 1 at camera.grab 1")
    done = gonio("calibrate", "camera", "--rig", rig_file(tmp_path), "-o", tmp_path / "c.npz")
    assert "darks: 6 exposures" in done.stderr
    assert "photon transfer" not in done.stderr


def test_a_camera_that_fails_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GONIO_FAULTS", "camera is unplugged at camera.grab 20")
    done = gonio("calibrate", "camera", "--rig", rig_file(tmp_path), "-o", tmp_path / "c.npz")
    assert done.returncode == 3
    assert not (tmp_path / "c.npz").exists()
