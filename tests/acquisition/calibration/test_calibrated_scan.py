"""A rig file that names the calibration of its camera: its use in a scan, and its refusal."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from acquisition.plan.plan import make_plan
from acquisition.results.reduction import LINEARITY, reduced_run
from acquisition.results.run_folder import (
    CALIBRATION_FILE,
    load_run_inputs,
    run_meta,
    write_run_inputs,
)
from instrument.calibration.camera_file import read_camera_file, write_camera_file
from instrument.config.load import Loaded, load_protocol
from instrument.errors import InputError
from instrument.record.record import Record
from tests.support.command import gonio_here as gonio
from tests.support.paths import CONFIGS
from tests.support.scans import small_demo
from tests.support.whole_scans.stopped_scan import scan

BENCH = CONFIGS / "rigs" / "bench_12bit.yaml"
DEFECTS = {"nonlinearity": 0.05}


def rig_file(folder: Path, name: str, defects: dict[str, Any], **camera: Any) -> Path:
    """The bench with a fifth of the pixels a side."""
    rig = yaml.safe_load(BENCH.read_text())
    for key in ("width_px", "height_px", "axis_row_px", "axis_column_px"):
        rig["camera"][key] = type(rig["camera"][key])(rig["camera"][key] / 5)
    rig["camera"] |= camera
    rig["simulation"]["camera_defects"] = defects
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(rig))
    return path


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a protocol, and the rig and calibration of a camera that is not linear."""
    folder = tmp_path_factory.mktemp("bench")
    protocol = small_demo(folder)
    protocol.write_text(protocol.read_text().replace("num: 9", "num: 4"))
    bare = rig_file(folder, "bare", DEFECTS)
    quick = ("--exposures", "18", "--frames", "2")
    done = gonio("calibrate", "camera", "--rig", bare, "-o", folder / "camera.npz", *quick)
    assert done.returncode == 0, done.stderr
    rig_file(folder, "calibrated", DEFECTS, calibration="camera.npz")
    rig_file(folder, "ideal", {})
    return folder


def loaded(bench: Path, rig: str) -> Loaded:
    return load_protocol(bench / "small.yaml", bench / f"{rig}.yaml")


def rates(bench: Path, rig: str, folder: Path) -> np.ndarray:
    """Counts per second of each reading of a scan; the u of its points is checked too."""
    own = loaded(bench, rig)
    with Record.create(folder / rig, run_meta(own, make_plan(own))) as record:
        scan(own, record)
        parts, measured = reduced_run(record, own).parts, own.rig.camera.measured
        if measured is None:
            assert LINEARITY not in parts
        else:
            assert parts[LINEARITY] == pytest.approx(measured.u_light_relative)
            assert measured.u_light_relative > 0
        return np.array([r.signal_dn / r.exposure_s for r in record.readings()])


def test_a_scan_with_the_calibration_is_linear(bench: Path, tmp_path: Path) -> None:
    """Scales may differ by a factor that all points share: the white tile takes it off."""
    ideal, bare, calibrated = (rates(bench, n, tmp_path) for n in ("ideal", "bare", "calibrated"))
    wrong = [float(np.std(rate / ideal) / np.mean(rate / ideal)) for rate in (bare, calibrated)]
    assert wrong[0] > 2e-3
    assert wrong[1] < 0.1 * wrong[0]
    assert wrong[1] < 3e-4


def test_a_run_keeps_what_it_used_of_the_calibration(bench: Path, tmp_path: Path) -> None:
    """It needs neither the file that the rig named nor its own copy."""
    own = loaded(bench, "calibrated")
    digest = read_camera_file(bench / "camera.npz").sha256
    with Record.create(tmp_path / "run", run_meta(own, make_plan(own))) as record:
        for _ in range(2):
            write_run_inputs(record)
            copy = record.folder / CALIBRATION_FILE
            assert json.loads(copy.read_text())["sha256"] == digest
            again = load_run_inputs(record).rig.camera
            counts = np.arange(0, 4096, 15)
            assert again.linear_dn(counts) == pytest.approx(own.rig.camera.linear_dn(counts))
            copy.unlink()
        write_run_inputs(record)
        copy.write_text(copy.read_text().replace("bench_12bit", "bench_13bit"))
        with pytest.raises(InputError, match=f"{CALIBRATION_FILE}: changed since the run began"):
            load_run_inputs(record)


def test_a_rig_without_a_calibration_takes_counts_as_they_are(bench: Path) -> None:
    counts = np.arange(4096, dtype=np.uint16)
    assert loaded(bench, "bare").rig.camera.linear_dn(counts) is counts


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"camera": "Other camera 7"}, "is the calibration of 'Other camera 7', but the camera is"),
        ({"settings": {"gain": "200"}}, "was made with gain '200', but the camera has '100'"),
        ({"date_utc": "2020-02-01T00:00:00+00:00"}, "days old; allowed: 365. Calibrate again"),
        ({"date_utc": "2999-02-01T00:00:00+00:00"}, "in the future: check the computer's clock"),
        ({"max_dn": 255.0}, "of a camera with counts to 255; allowed: to 4095"),
    ],
)
def test_another_camera_s_or_an_outdated_calibration_is_refused(
    bench: Path, tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    """With exit code 2, before anything moves or is written."""
    small_demo(tmp_path)
    other = replace(read_camera_file(bench / "camera.npz"), **change)
    write_camera_file(tmp_path / "camera.npz", other)
    rig = rig_file(tmp_path, "rig", DEFECTS, calibration="camera.npz")
    done = gonio("run", tmp_path / "small.yaml", "--rig", rig, "--out", tmp_path / "run")
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert "camera.npz" in done.stderr
    assert not (tmp_path / "run").exists()


def test_a_calibration_that_is_not_there_is_a_mistake_in_the_rig_file(tmp_path: Path) -> None:
    small_demo(tmp_path)
    rig = rig_file(tmp_path, "rig", {}, calibration="none.npz")
    done = gonio("plan", tmp_path / "small.yaml", "--rig", rig)
    assert done.returncode == 2
    line = next(n for n, t in enumerate(rig.read_text().splitlines(), 1) if "none.npz" in t)
    assert f"rig.yaml:{line}:16: camera.calibration: " in done.stderr
    assert "none.npz: cannot be read" in done.stderr
    # To calibrate it needs no calibration.
    assert gonio("calibrate", "camera", "--rig", rig, "--plan").returncode == 0
