"""A rig file that names the calibration of its geometry: its values, its use, its refusal."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from acquisition.plan.plan import make_plan
from acquisition.results.run_folder import (
    GEOMETRY_FILE,
    load_run_inputs,
    run_meta,
    write_run_inputs,
)
from acquisition.rig import OpenRig
from instrument.calibration.geometry_file import CAMERA_KEYS, DISTORTION, write_geometry_file
from instrument.calibration.quantity import Quantity
from instrument.config.load import load_protocol, load_rig
from instrument.errors import InputError
from instrument.pinhole import Pinhole
from instrument.record.record import Record
from sim.scene.scene import Scene
from tests.support.calibration.geometry_files import FOUND
from tests.support.command import gonio_here as gonio
from tests.support.paths import CONFIGS
from tests.support.scans import small_demo

BENCH = yaml.safe_load((CONFIGS / "rigs" / "bench_12bit.yaml").read_text())
CAMERA = "simulated camera, 640 x 512 pixels, 12 bit"
OWN = replace(FOUND, camera=CAMERA, date_utc=datetime.now(UTC).isoformat(timespec="seconds"))


def rig_file(folder: Path, *, without: tuple[str, ...] = (), **change: Any) -> Path:
    """The bench with a calibration of its geometry, and without some keys of its camera."""
    write_geometry_file(folder / "geometry.npz", replace(OWN, **change))
    camera = {key: value for key, value in BENCH["camera"].items() if key not in without}
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump({**BENCH, "camera": camera, "geometry": "geometry.npz"}))
    return path


@pytest.mark.parametrize("without", [(), CAMERA_KEYS])
def test_the_rig_takes_the_values_with_or_without_numbers_of_its_own(
    tmp_path: Path, without: tuple[str, ...]
) -> None:
    bent = Quantity(value=-1.5, u=0.1, unit="%", symbol="", name="distortion")
    path = rig_file(tmp_path, without=without, quantities={**OWN.quantities, DISTORTION: bent})
    rig = load_rig(path)
    pinhole = Pinhole.of(rig)
    assert (pinhole.distortion, rig.typed.camera.distortion) == (-0.015, 0.0)
    for key, value in OWN.camera_values().items():
        assert getattr(pinhole, key) == value
        stated = value if without else BENCH["camera"].get(key)
        assert getattr(rig.typed.camera, key) == stated
    assert rig.uncertainty.u_zero_theta_r_deg == 0.01
    for wrong in (-35.0, float("nan")):
        own = {**OWN.quantities, DISTORTION: replace(bent, value=wrong)}
        with pytest.raises(InputError, match=r"distortion (-35|nan) %; allowed: up to 20 %"):
            load_rig(rig_file(tmp_path, without=without, quantities=own))
    assert (rig.axes.theta_r.zero_deg, rig.typed.axes.theta_r.zero_deg) == (-0.05, 0.0)


def test_the_axis_reports_true_angles_for_any_zero_and_sign() -> None:
    """The stage's own limits and home stay where they are in the device's degrees."""
    rng = np.random.default_rng(11)
    plain = load_rig(CONFIGS / "rigs" / "bench_12bit.yaml")
    for sign in (1, -1, 1, -1):
        typed_deg, error_deg, angle_deg = rng.uniform([-30, -2, -60], [30, 2, 60]).tolist()
        own = {"zero_deg": typed_deg, "sign": sign, "u_deg": 0.0}
        axis = plain.axes.theta_r.model_copy(update=own)
        defects = plain.simulation.axis_defects
        beam = defects.theta_r.model_copy(update={"zero_deg": error_deg})
        simulation = plain.simulation.model_copy(
            update={"axis_defects": defects.model_copy(update={"theta_r": beam})}
        )
        axes = plain.axes.model_copy(update={"theta_r": axis})
        rig = plain.model_copy(update={"axes": axes, "simulation": simulation})
        zero_deg = typed_deg - sign * error_deg
        told = rig.with_geometry(replace(OWN, zero_deg=zero_deg, sign=sign))
        limits = told.axes.theta_r.device_limits_deg()
        assert limits == pytest.approx(axis.device_limits_deg())
        scene = Scene.of_white_sample(told.typed)
        with OpenRig(told, scene) as opened:
            stage = opened.axis("theta_r")
            stage.home()
            assert scene.true_deg["theta_r"] == pytest.approx(told.axes.theta_r.home_deg)
            stage.start_move(angle_deg)
            stage.finish_move()
            assert scene.true_deg["theta_r"] == pytest.approx(angle_deg)
            assert stage.position_deg() == pytest.approx(angle_deg)


def test_a_run_keeps_what_it_used_of_the_calibration(tmp_path: Path) -> None:
    own = load_protocol(small_demo(tmp_path), rig_file(tmp_path, without=CAMERA_KEYS))
    with Record.create(tmp_path / "run", run_meta(own, make_plan(own))) as record:
        write_run_inputs(record)
        (tmp_path / "geometry.npz").unlink()
        again = load_run_inputs(record)
        assert again.rig.camera == own.rig.camera
        assert again.rig.axes == own.rig.axes
        copy = record.folder / GEOMETRY_FILE
        copy.write_text(copy.read_text().replace("stage 2", "stage 3"))
        with pytest.raises(InputError, match=f"{GEOMETRY_FILE}: changed since the run began"):
            load_run_inputs(record)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"camera": "Other camera 7"}, "is the calibration of 'Other camera 7', but the camera is"),
        ({"date_utc": "2020-02-01T00:00:00+00:00"}, "days old; allowed: 365. Calibrate again"),
        ({"size_px": (320, 256)}, "of a camera with 320 x 256 pixels; allowed: 640 x 512"),
        ({"sign": -1}, "of theta_r with sign -1; allowed: 1. Calibrate again"),
        ({"zero_deg": 7.0}, "theta_r reads 7 at 0; allowed: up to 5 deg from its zero_deg, 0"),
    ],
)
def test_another_camera_s_or_an_outdated_calibration_is_refused(
    tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    """With exit code 2, before anything moves or is written."""
    rig = rig_file(tmp_path, **change)
    done = gonio("run", small_demo(tmp_path), "--rig", rig, "--out", tmp_path / "run")
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert "geometry.npz" in done.stderr
    assert not (tmp_path / "run").exists()


def test_a_calibration_that_is_not_there_is_a_mistake_in_the_rig_file(tmp_path: Path) -> None:
    rig = rig_file(tmp_path)
    (tmp_path / "geometry.npz").unlink()
    with pytest.raises(InputError, match=r"rig.yaml:\d+:\d+: geometry: .*cannot be read"):
        load_rig(rig)
