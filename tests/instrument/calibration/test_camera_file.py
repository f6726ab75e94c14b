"""File of a camera's calibration: read as written, and refused where it cannot be believed."""

from __future__ import annotations

import json
import zipfile
from dataclasses import fields, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from instrument.calibration.camera_calibration import MAPS, CameraCalibration
from instrument.calibration.camera_file import read_camera_file, write_camera_file
from instrument.calibration.quantity import Quantity
from instrument.calibration.response_curve import GAMMA, POLYNOMIAL, ResponseCurve
from instrument.errors import InputError

NOW = datetime(2026, 11, 27, 20, 0, tzinfo=UTC)


def calibration(**changed: Any) -> CameraCalibration:
    rng = np.random.default_rng(3)
    arrays = {name: rng.standard_normal((6, 8)) for name in MAPS}
    for name in ("hot", "measured", "deviant"):
        arrays[name] = rng.random((6, 8)) > 0.5
    arrays |= {"lit": rng.random((9, 6)), "dark": rng.random((4, 6))}
    gain = Quantity(value=0.13437, u=5e-5, unit="DN/e-", symbol="K", name="gain")
    none = Quantity(value=None, u=None, unit="e-", symbol="sigma_d", name="dark noise")
    own = CameraCalibration(
        camera="Maker M1, serial 7", settings={"gain": "100"}, rig="bench",
        date_utc=NOW.isoformat(), program="gonio 0", quantities={"gain": gain, "noise": none},
        curve=ResponseCurve(POLYNOMIAL, (0.01, -0.002)), black_dn=64.03, max_dn=4095.0,
        low_dn=90.0, high_dn=3900.0, u_light_relative=1e-4, notes=("a note",), arrays=arrays,
    )  # fmt: skip
    return replace(own, **changed)


def test_a_calibration_is_read_as_it_was_written(tmp_path: Path) -> None:
    written = write_camera_file(tmp_path / "c.npz", calibration())
    found = read_camera_file(tmp_path / "c.npz")
    for field in fields(CameraCalibration):
        if field.name != "arrays":
            assert getattr(found, field.name) == getattr(written, field.name), field.name
    assert len(found.sha256) == 64
    for name, values in written.arrays.items():
        assert found.arrays[name] == pytest.approx(values, rel=1e-6), name
    assert found.arrays["hot"].dtype == np.bool_


def test_equal_calibrations_are_equal_files_and_others_have_another_hash(tmp_path: Path) -> None:
    one, same = (write_camera_file(tmp_path / f"{n}.npz", calibration()) for n in "ab")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert one.sha256 == same.sha256
    arrays = {**calibration().arrays, "lit": calibration().arrays["lit"] + 1e-9}
    for other in (calibration(rig="other"), calibration(arrays=arrays)):
        assert write_camera_file(tmp_path / "c.npz", other).sha256 != one.sha256


def test_any_program_reads_it(tmp_path: Path) -> None:
    write_camera_file(tmp_path / "c.npz", calibration())
    with np.load(tmp_path / "c.npz", allow_pickle=False) as archive:
        assert archive["dark_offset_dn"].shape == (6, 8)
    with zipfile.ZipFile(tmp_path / "c.npz") as archive:
        header = json.loads(archive.read("calibration.json"))
    assert header["quantities"]["gain"]["value"] == 0.13437


def rewritten(path: Path, change: Any) -> None:
    """Change members of a file, by their names, as another program would."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    change(members)
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def header_with(**changes: Any) -> Any:
    def change(members: dict[str, bytes]) -> None:
        header = {**json.loads(members["calibration.json"]), **changes}
        members["calibration.json"] = json.dumps(header).encode()

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (header_with(rig="another"), "was changed or damaged since it was written"),
        (header_with(version=2), "version 2; allowed: 'gonio camera calibration', version 1"),
        (header_with(format="x"), "is 'x', version 1"),
        (lambda m: m.pop("lit.npy"), "was changed or damaged"),
        (lambda m: m.pop("calibration.json"), "is no camera calibration"),
        (lambda m: m.update({"calibration.json": b"[1"}), "is no camera calibration"),
        (lambda m: m.update({"calibration.json": b"[1]"}), "is no camera calibration"),
        (lambda m: m.update({"hot.npy": m["hot.npy"][:-9]}), "is no camera calibration"),
    ],
)  # fmt: skip
def test_a_file_that_was_changed_is_refused(tmp_path: Path, change: Any, words: str) -> None:
    path = tmp_path / "c.npz"
    write_camera_file(path, calibration())
    rewritten(path, change)
    with pytest.raises(InputError, match=words):
        read_camera_file(path)


@pytest.mark.parametrize(
    "changed",
    [
        {"arrays": {"lit": np.zeros((2, 6)), "dark": np.zeros((2, 6))}},
        {"arrays": {**calibration().arrays, "hot": np.zeros((3, 3), bool)}},
        {"arrays": {**calibration().arrays, "lit": np.zeros(4)}},
        {"curve": ResponseCurve("mystery", ())},
        {"curve": ResponseCurve(GAMMA, ())},
        {"max_dn": float("nan")},
    ],
)
def test_a_file_that_lacks_something_is_refused(tmp_path: Path, changed: Any) -> None:
    """Its hash is right: somebody's own program wrote it."""
    write_camera_file(tmp_path / "c.npz", calibration(**changed))
    with pytest.raises(InputError, match="lacks what a calibration needs"):
        read_camera_file(tmp_path / "c.npz")


@pytest.mark.parametrize("content", [b"", b"no zip", b"PK\x03\x04" + bytes(40)])
def test_another_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "c.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"c\.npz: is no camera calibration"):
        read_camera_file(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_camera_file(tmp_path / "none.npz")


def test_each_byte_that_flips_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "c.npz"
    good = write_camera_file(path, calibration())
    raw = path.read_bytes()
    rng = np.random.default_rng(8)
    for place in rng.integers(0, len(raw), 40).tolist():
        path.write_bytes(raw[:place] + bytes([raw[place] ^ 0x10]) + raw[place + 1 :])
        try:
            found = read_camera_file(path)
        except InputError:
            continue
        assert found.sha256 == good.sha256  # a byte that means nothing, as a member's date
        assert found.quantities == good.quantities


def test_another_camera_or_setting_is_refused() -> None:
    own = calibration()
    own.require_camera("c.npz", "Maker M1, serial 7", {"gain": "100", "temperature": "20"})
    own.require_camera("c.npz", "Maker M1, serial 7", {})
    with pytest.raises(InputError, match="of 'Maker M1, serial 7', but the camera is 'Maker M1, s"):
        own.require_camera("c.npz", "Maker M1, serial 8", {})
    with pytest.raises(InputError, match="with gain '100', but the camera has '200'"):
        own.require_camera("c.npz", "Maker M1, serial 7", {"gain": "200"})


def test_an_outdated_calibration_is_refused() -> None:
    own = calibration()
    own.require_date("c.npz", NOW + timedelta(days=364))
    with pytest.raises(InputError, match="is 366 days old; allowed: 365"):
        own.require_date("c.npz", NOW + timedelta(days=366))
    with pytest.raises(InputError, match="allowed: 30"):
        own.require_date("c.npz", NOW + timedelta(days=31), 30.0)
    with pytest.raises(InputError, match="in the future"):
        own.require_date("c.npz", NOW - timedelta(days=2))


def test_linear_counts_leave_black_and_full_scale_in_their_place() -> None:
    own = calibration(curve=ResponseCurve(GAMMA, (2.2,)))
    counts = np.array([64.03, 2079.515, 4095.0])
    linear = own.linear_counts_dn(counts)
    assert linear == pytest.approx([64.03, 64.03 + 4030.97 * 0.5**2.2, 4095.0])
