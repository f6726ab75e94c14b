"""Values that a camera's calibration found stand in the rig file, with their u."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from acquisition.drafts.checks import rig_draft
from acquisition.drafts.interview import Interview
from acquisition.drafts.rig_questions import Bench
from instrument.calibration.camera_calibration import MAPS, CameraCalibration
from instrument.calibration.camera_file import is_camera_file, write_camera_file
from instrument.calibration.geometry_file import write_geometry_file
from instrument.calibration.lamp_file import (
    LampCalibration,
    LightMap,
    is_lamp_file,
    write_lamp_file,
)
from instrument.calibration.quantity import Quantity
from instrument.calibration.response_curve import POLYNOMIAL, ResponseCurve
from instrument.config.load import load_rig
from instrument.errors import InputError
from tests.support.calibration.geometry_files import FOUND as GEOMETRY

REAL = {"camera": "/dev/video9", "camera.size": "640 x 512"}
FOUND = {
    "gain_dn_per_electron": (0.2, 0.001, "DN/e-"),
    "dark_noise_electrons": (6.25, 0.04, "e-"),
    "dark_current_electrons_per_s": (-0.5, 1.0, "e-/s"),  # none, within its u
    "dark_dn": (100.0, 0.01, "DN"),
    "flicker_percent": (0.07, None, "%"),
    "black_wander_dn": (0.001, None, "DN"),  # of a few minutes: no reason for an alarm
}


def calibration_file(path: Path, max_dn: float = 4095.0, **changed: float | None) -> Path:
    """A calibration of a camera with 64 x 48 pixels."""
    found = {k: (changed.get(k, value), u, unit) for k, (value, u, unit) in FOUND.items()}
    quantities = {
        key: Quantity(value=value, u=u, unit=unit, symbol="", name=key)
        for key, (value, u, unit) in found.items()
    }
    arrays = {name: np.zeros((48, 64)) for name in MAPS}
    arrays |= {"lit": np.ones((9, 6)), "dark": np.ones((4, 6))}
    calibration = CameraCalibration(
        camera="Maker M1\n#7", settings={}, rig="bench", date_utc="2026-11-27T20:00:00+00:00",
        program="gonio 0", quantities=quantities, curve=ResponseCurve(POLYNOMIAL, (0.0,)),
        black_dn=100.0, max_dn=max_dn, low_dn=110.0, high_dn=3900.0, u_light_relative=1e-4,
        notes=(), arrays=arrays,
    )  # fmt: skip
    write_camera_file(path, calibration)
    return path


def lamp_file(path: Path, flicker: Quantity) -> None:
    calibration = LampCalibration(
        lamp="a lamp", camera="Maker M1", settings={}, rig="bench", pose_deg={"theta_i": 30.0},
        date_utc="2026-11-27T20:00:00+00:00", program="gonio 0", steady=True,
        quantities={"flicker_percent": flicker},
        light_map=LightMap(exponents=((0, 0),), coefficients=(1.0,), half_mm=20.0),
        notes=(), arrays={"readings": np.ones((5, 3)), "cells": np.ones((7, 4))},
    )  # fmt: skip
    write_lamp_file(path, calibration)


def test_a_lamps_calibration_fills_in_its_flicker(tmp_path: Path) -> None:
    flicker = Quantity(value=0.081, u=0.004, unit="%", symbol="", name="flicker")
    lamp_file(tmp_path / "lamp.npz", flicker)
    (tmp_path / "scratch").mkdir()
    draft = rig_draft(Bench(folder=tmp_path, name="bench"), tmp_path / "scratch")
    text = Interview(given={"lamp_calibration": "lamp.npz"}).text_of(draft)
    assert yaml.safe_load(text)["lamp"]["u_flicker"] == 0.00085
    assert "# measured: 0.081 ± 0.004 %, rounded up" in text
    lamp_file(tmp_path / "lamp.npz", replace(flicker, value=None, u=None))
    with pytest.raises(InputError, match=r"--set lamp_calibration: .*lamp\.npz: holds no flicker"):
        Interview(given={"lamp_calibration": "lamp.npz"}).text_of(draft)


def test_only_calibrations_of_each_kind_are_offered(tmp_path: Path) -> None:
    calibration_file(tmp_path / "camera.npz")
    lamp_file(tmp_path / "lamp.npz", Quantity(value=0.1, u=0.1, unit="%", symbol="", name=""))
    np.savez(tmp_path / "other.npz", x=np.ones(3))
    (tmp_path / "text.npz").write_text("text")
    paths = sorted(tmp_path.iterdir())
    assert [path.name for path in paths if is_camera_file(path)] == ["camera.npz"]
    assert [path.name for path in paths if is_lamp_file(path)] == ["lamp.npz"]


def rig_text(folder: Path, size: str = "64 x 48", calibration: str = "1") -> str:
    """Text of a rig whose calibration is the first of those offered, for a file in `folder`."""
    (folder / "scratch").mkdir(exist_ok=True)
    bench = Bench(folder=folder, name="bench", calibrations=sorted(folder.glob("*.npz")))
    given = {"camera.size": size, "calibration": calibration}
    return Interview(given=given).text_of(rig_draft(bench, folder / "scratch"))


def test_a_rig_file_holds_what_the_calibration_found(tmp_path: Path) -> None:
    calibration_file(tmp_path / "c.npz")
    path = tmp_path / "rig.yaml"
    path.write_text(rig_text(tmp_path))
    rig = load_rig(path)
    camera = yaml.safe_load(path.read_text())["camera"]
    assert camera["calibration"] == "c.npz"
    assert camera["read_noise_electrons"] == 6.25
    assert camera["dark_current_electrons_per_s"] == 0.0
    assert camera["black_level_dn"] == 100.0
    assert camera["u_black_level_dn"] == 0.25  # the least
    assert 1 / rig.camera.electrons_per_dn == pytest.approx(0.2, rel=1e-4)
    assert rig.lamp.u_flicker == pytest.approx(0.0007)
    assert "# the least; measured: 0.001 DN" in path.read_text()
    assert "# measured: 6.25 ± 0.04 e-" in path.read_text()
    assert r"# Calibration of Maker M1\n#7, 2026-11-27" in path.read_text()


def test_what_was_not_determined_keeps_its_usual_value(tmp_path: Path) -> None:
    """Behind a gamma, noise and dark current cannot be told."""
    calibration_file(tmp_path / "c.npz", dark_noise_electrons=None, gain_dn_per_electron=None)
    text = rig_text(tmp_path)
    camera = yaml.safe_load(text)["camera"]
    assert (camera["read_noise_electrons"], camera["full_well_electrons"]) == (8.0, 30000.0)
    assert "# assumed: gonio calibrate camera measures it" in text


@pytest.mark.parametrize(
    ("size", "changed", "reason"),
    [
        ("640 x 480", {}, r"64 x 48 pixels; allowed: 640 x 480"),
        ("64 x 48", {"max_dn": 255.0}, "of a camera with counts to 255; allowed: to 4095"),
        ("64 x 48", {"dark_noise_electrons": 900.0}, "black_level_dn: .* 4 times the read noise"),
    ],
)
def test_a_calibration_that_does_not_fit_is_refused(
    size: str, changed: dict[str, float], reason: str, tmp_path: Path
) -> None:
    calibration_file(tmp_path / "c.npz", **changed)
    with pytest.raises(InputError, match=f"--set calibration: .*{reason}"):
        rig_text(tmp_path, size)


def test_another_file_is_no_calibration(tmp_path: Path) -> None:
    (tmp_path / "x.npz").write_text("x")
    for name in ("x.npz", "gone.npz", "y" * 300):
        with pytest.raises(InputError, match=r"--set calibration: .*(is no camera cal|cannot be)"):
            rig_text(tmp_path, calibration=name)


@pytest.mark.parametrize(
    ("zero_deg", "sign", "given"),
    [
        (-0.05, 1, {}),
        (90.25, -1, REAL | {"theta_r.driver": "hand"}),
        (90.25, -1, REAL | {"theta_r.driver": "newport", "theta_r.port": "/dev/ttyUSB0"}),
    ],
    ids=["simulated", "hand", "motor"],
)
def test_a_geometry_takes_the_place_of_typed_numbers(
    tmp_path: Path, zero_deg: float, sign: int, given: dict[str, str]
) -> None:
    """Also of a stage that is mounted at any angle; a simulated rig keeps its own zero."""
    write_geometry_file(tmp_path / "g.npz", replace(GEOMETRY, zero_deg=zero_deg, sign=sign))
    (tmp_path / "scratch").mkdir()
    bench = Bench(folder=tmp_path, name="bench", geometries=[tmp_path / "g.npz"])
    text = Interview(given=given | {"geometry": "g.npz"}).text_of(
        rig_draft(bench, tmp_path / "scratch")
    )
    assert "field_width_mm:" not in text
    path = tmp_path / "rig.yaml"
    path.write_text(text)
    rig = load_rig(path)
    assert rig.camera.field_width_mm == GEOMETRY.field_width_mm
    assert (rig.axes.theta_r.zero_deg, rig.axes.theta_r.sign) == (zero_deg, sign)


def test_a_geometry_of_another_picture_is_refused(tmp_path: Path) -> None:
    write_geometry_file(tmp_path / "g.npz", GEOMETRY)
    (tmp_path / "scratch").mkdir()
    bench = Bench(folder=tmp_path, name="bench", geometries=[tmp_path / "g.npz"])
    with pytest.raises(InputError, match=r"--set geometry: .*another size; allowed: 64 x 48"):
        Interview(given={"camera.size": "64 x 48", "geometry": "g.npz"}).text_of(
            rig_draft(bench, tmp_path / "scratch")
        )
