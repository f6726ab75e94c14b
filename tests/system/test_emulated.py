"""Whole scans with the real drivers over emulated devices."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

from sim.emulated.bench import CAMERA_DEVICE
from sim.emulated.v4l2.shim import compile_shim, shim_environment
from tests.support.command import gonio, gonio_here
from tests.support.paths import CONFIGS
from tests.support.ready.ready_process import ReadyProcess
from tests.support.scans import TWO_MODELS, small_demo
from tests.support.whole_scans.simulated_rig import (
    EMULATED_RIG,
    assert_same_within_noise,
    points,
    quick_emulated_rig,
    simulated,
)

pytestmark = [
    pytest.mark.long,
    pytest.mark.real_time,
    pytest.mark.skipif(
        shutil.which("cc") is None, reason="the emulated camera needs a C compiler (cc)"
    ),
]
TRUTH = {"albedo": 0.80, "sigma_deg": 20.0, "ks": 0.076}


@pytest.fixture(scope="module")
def protocol(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demonstration with two incidences, nine view angles and two models."""
    return small_demo(tmp_path_factory.mktemp("protocol"), TWO_MODELS)


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ReadyProcess]:
    """The command as it is once it has restarted with the emulated camera's library."""
    folder = tmp_path_factory.mktemp("camera")
    environment = shim_environment(compile_shim(folder), CAMERA_DEVICE, folder / "socket")
    with ReadyProcess(environment=environment) as ready:
        yield ready


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, protocol: Path, command: ReadyProcess) -> Path:
    folder = tmp_path_factory.mktemp("emulated")
    rig = folder / "rig.yaml"
    rig.write_text(quick_emulated_rig())
    done = command.run("run", protocol, "--rig", rig, "--out", folder / "run")
    assert done.returncode == 0, done.stderr
    return folder / "run"


def test_the_fit_recovers_the_true_parameters_within_their_uncertainty(run: Path) -> None:
    fit = json.loads((run / "fit.json").read_text())
    assert (fit["chosen"], fit["verdict"]) == ("oren_nayar+torrance_sparrow", "adequate")
    fitted = next(c for c in fit["candidates"] if c["model"] == fit["chosen"])["parameters"]
    for name, true in TRUTH.items():
        assert abs(fitted[name]["value"] - true) < 4 * fitted[name]["u"], name


def test_each_point_agrees_with_the_simulated_rig(
    run: Path, tmp_path: Path, protocol: Path
) -> None:
    """With the same optics and lamp only noise, drift and angle errors differ."""
    simulated_rig = tmp_path / "simulated.yaml"
    simulated_rig.write_text(simulated(quick_emulated_rig()))
    done = gonio_here("run", protocol, "--rig", simulated_rig, "--out", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    assert_same_within_noise(points(run), points(tmp_path / "run"))


def test_the_record_holds_the_devices_identities_and_the_frames_times(run: Path) -> None:
    with sqlite3.connect(f"file:{run / 'record.sqlite'}?mode=ro", uri=True) as record:
        devices = dict(record.execute("SELECT role, identity FROM device"))
        frames = record.execute(
            "SELECT step, time_s, device_time_s FROM frame ORDER BY step, number"
        ).fetchall()
        readings = dict(record.execute("SELECT step, frames FROM reading"))
    assert "SMC100" in devices["theta_i"]
    assert "Oriental Motor AZ" in devices["dphi"]
    assert "Zaber" in devices["theta_r"]
    assert "12 bit" in devices["camera"]
    assert len(frames) == sum(readings.values())
    stamps = [stamp for _, _, stamp in frames]
    assert stamps == sorted(stamps)
    delays_s = [read - stamp for _, read, stamp in frames]
    assert min(delays_s) >= 0
    # On one clock; now and then this process is kept from running.
    assert np.median(delays_s) < 0.5


def test_an_exposure_that_the_camera_does_not_make_ends_the_scan(
    tmp_path: Path, protocol: Path, command: ReadyProcess
) -> None:
    """The control takes and reads back any exposure; the sensor makes 0.5 ms at most."""
    rig = tmp_path / "rig.yaml"
    rig.write_text(quick_emulated_rig() + "  camera_defects: {longest_exposure_s: 0.0005}\n")
    done = command.run("run", protocol, "--rig", rig, "--out", tmp_path / "run")
    assert done.returncode == 3
    assert re.search("camera: (counts at|its frames come every)", done.stderr), done.stderr
    assert done.stderr.rstrip().endswith("Correct the rig file, then start a new run")


def test_a_stopped_scan_is_resumed_where_it_ended(
    tmp_path: Path, protocol: Path, command: ReadyProcess
) -> None:
    folder, rig = tmp_path / "run", tmp_path / "rig.yaml"
    rig.write_text(quick_emulated_rig())
    process = command.start("run", protocol, "--rig", rig, "--out", folder)
    wait_for_readings(folder, 5, command)
    os.kill(process, signal.SIGTERM)
    stopped = command.finish()
    assert stopped.returncode == 4
    assert f"gonio resume {folder}" in stopped.stderr
    done = command.run("resume", folder, "--yes", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["verdict"] == "adequate"
    assert len(points(folder)) == 17  # in the eighteenth, camera and lamp obstruct each other


def wait_for_readings(folder: Path, count: int, command: ReadyProcess) -> None:
    """Wait until the scan that runs has so many readings; fail if it ends before."""
    end_s = time.monotonic() + 120
    while time.monotonic() < end_s and not command.has_ended():
        try:
            with sqlite3.connect(f"file:{folder / 'record.sqlite'}?mode=ro", uri=True) as record:
                if record.execute("SELECT COUNT(*) FROM reading").fetchone()[0] >= count:
                    return
        except sqlite3.Error:
            pass  # does not exist yet
        time.sleep(0.01)
    outcome = command.finish() if command.has_ended() else "after 120 s"
    raise AssertionError(f"fewer than {count} readings: {outcome}")


def test_devices_lists_the_identity_of_every_device(command: ReadyProcess) -> None:
    done = command.run("devices", "--rig", EMULATED_RIG)
    assert done.returncode == 0, done.stderr
    for word in ("SMC100", "Oriental Motor AZ", "Zaber device", "Y16 320 x 256 pixels"):
        assert word in done.stdout


def test_grab_takes_a_frame_with_the_emulated_camera(tmp_path: Path) -> None:
    """As an operator starts it: the program restarts with the camera's library."""
    done = gonio(
        "grab", "--rig", EMULATED_RIG, "-o", tmp_path / "aim.png", "--exposure-s", "0.001", "--json"
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["window_mean_dn"] > 200


@pytest.mark.parametrize("luma_range", ["full", "limited"])
def test_white_of_a_limited_range_is_saturated_or_the_camera_refused(
    tmp_path: Path, luma_range: str, command: ReadyProcess
) -> None:
    rig = yaml.safe_load(EMULATED_RIG.read_text())
    rig["camera"] |= {
        "pixel_format": "YUYV", "bit_depth": 8, "black_level_dn": 20.0,
        "read_noise_electrons": 60.0, "luma_range": luma_range,
    }  # fmt: skip
    rig["simulation"]["camera_defects"] = {"limited_range": "declared"}
    path = tmp_path / "rig.yaml"
    path.write_text(yaml.safe_dump(rig))
    to = tmp_path / "aim.png"
    done = command.run("grab", "--rig", path, "-o", to, "--exposure-s", "0.1", "--json")
    if luma_range == "full":
        assert done.returncode == 3
        assert "its YUYV has limited range: black is 16 and white 235" in done.stderr
        return
    found = json.loads(done.stdout)
    assert (found["frame_max_dn"], found["full_scale_dn"]) == (235, 235)
    assert found["saturated_pixels"] > 1000
    assert "pixels are saturated (at 235 DN" in done.stderr


def test_move_homes_and_moves_an_emulated_axis() -> None:
    done = gonio_here("move", "dphi", "30", "--rig", EMULATED_RIG)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.split()[-2]) == pytest.approx(30.0, abs=0.01)


def test_a_missing_compiler_is_reported_before_the_run_folder_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    protocol = CONFIGS / "protocols" / "demo.yaml"
    done = gonio_here("run", protocol, "--rig", EMULATED_RIG, "--out", tmp_path / "run")
    assert done.returncode == 3
    assert "no C compiler" in done.stderr
    assert not (tmp_path / "run").exists()


def test_an_axis_that_turns_is_measured_at_the_angles_of_its_frames(
    tmp_path: Path, protocol: Path, command: ReadyProcess
) -> None:
    """A steep lobe, of which a wrong angle or a blur would be seen; the model is the true one."""
    text = yaml.safe_load(protocol.read_text()) | {"motion": "fly", "frames_per_point": 1}
    views = {"start": -60.0, "stop": -10.0, "num": 11}
    text["sweeps"] = [{"theta_i_deg": [45.0], "dphi_deg": [0.0], "theta_r_deg": views}]
    text["simulated_sample"]["parameters"] |= {"sigma_deg": 8.0, "ks": 0.3}
    flown, rig, folder = tmp_path / "flown.yaml", tmp_path / "rig.yaml", tmp_path / "run"
    flown.write_text(yaml.safe_dump(text))
    rig.write_text(quick_emulated_rig().replace("frames_per_s: 400", "frames_per_s: 100"))
    done = command.run("run", flown, "--rig", rig, "--out", folder, "--json")
    assert done.returncode == 0, done.stderr
    fit = json.loads(done.stdout)
    assert (fit["chosen"], fit["verdict"]) == ("oren_nayar+torrance_sparrow", "adequate")
    with sqlite3.connect(f"file:{folder / 'record.sqlite'}?mode=ro", uri=True) as record:
        rows = record.execute(
            "SELECT theta_r_deg, blur_deg, u_latency_deg FROM reading WHERE kind = 'point'"
        ).fetchall()
        found = record.execute("SELECT text FROM event WHERE kind = 'latency'").fetchall()
    assert len(rows) == 11
    assert np.ptp([angle for angle, _, _ in rows]) > 45
    assert all(blur > 0 and u != 0 for _, blur, u in rows)
    latency_ms = float(found[0][0].split("s: ")[1].split()[0])
    assert abs(latency_ms) < 20.0  # read-out and line
