"""Plans and scans from Python are those of the commands."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from acquisition.notebook.runs import Run, load
from acquisition.notebook.scans import plan, run
from instrument.errors import InputError
from tests.support.command import gonio_here
from tests.support.paths import CONFIGS
from tests.support.scans import small_demo

DEMO = CONFIGS / "protocols" / "demo.yaml"


def test_a_plan_is_that_of_the_command(tmp_path: Path) -> None:
    protocol = small_demo(tmp_path)
    told = json.loads(gonio_here("plan", str(protocol), "--json", cwd=tmp_path).stdout)
    planned = plan(protocol)
    poses = [step["pose"] for step in told["steps"] if step["kind"] == "point"]
    assert planned.theta_i_deg.tolist() == [pose["theta_i"] for pose in poses]
    assert planned.theta_r_deg.tolist() == [pose["theta_r"] for pose in poses]
    assert planned.dphi_deg.tolist() == [pose["dphi"] for pose in poses]
    assert planned.duration_s == told["duration_s"]
    assert planned.hidden == len(told["hidden"])
    assert list(planned.can_determine) == told["can_determine"]
    assert list(planned.will_not_determine) == told["will_not_determine"]


def test_a_plan_in_one_line() -> None:
    assert repr(plan(DEMO)) == "<plan of 'demo': 96 points, 3 hidden, 306 s>"


def test_a_scan_leaves_the_files_of_the_command_and_returns_its_run(scanned: Run) -> None:
    names = {"record.sqlite", "report.html", "measurements.csv", "fit.json", "protocol.yaml"}
    assert names <= {path.name for path in scanned.folder.iterdir()}
    again = load(scanned.folder)
    np.testing.assert_array_equal(again.brdf_per_sr, scanned.brdf_per_sr)


def test_a_folder_that_is_not_empty_is_refused_before_anything_moves(scanned: Run) -> None:
    before = (scanned.folder / "record.sqlite").read_bytes()
    with pytest.raises(InputError, match=scanned.folder.name):
        run(scanned.folder / "protocol.yaml", scanned.folder / "rig.yaml", scanned.folder)
    assert (scanned.folder / "record.sqlite").read_bytes() == before


def test_an_emulated_camera_is_left_to_the_command(tmp_path: Path) -> None:
    out = tmp_path / "run"
    with pytest.raises(InputError, match="use the command gonio run"):
        run(DEMO, CONFIGS / "rigs" / "emulated.yaml", out)
    assert not out.exists()


def test_every_mistake_of_a_protocol_is_named(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(DEMO.read_text().replace("frames_per_point: 4", "frames_per_point: none"))
    with pytest.raises(InputError, match=r"wrong\.yaml:\d+:\d+: frames_per_point"):
        plan(path, CONFIGS / "rigs" / "bench_12bit.yaml")
