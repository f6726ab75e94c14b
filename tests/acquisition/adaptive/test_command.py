"""`gonio run --until`: goal, choices and their reasons in all that a run leaves; wrong goals."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import pytest

from instrument.record.reading import batches_of
from instrument.record.record import Record
from tests.support.command import gonio_here as gonio
from tests.support.scans import small_demo
from tests.support.terminal.ctrl_c import ctrl_c_after


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A matt sample, few pixels, two incidences of nine views; 30 candidates."""
    path = small_demo(tmp_path_factory.mktemp("protocol"), "lambert, minnaert")
    matt = "model: lambert\n  parameters: {albedo: 0.8}"
    text = re.sub(r"model: oren_nayar.*\n.*\}", matt, path.read_text())
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def run(small: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A run that was stopped with Ctrl-C and resumed, and what was printed."""
    folder = tmp_path_factory.mktemp("runs") / "run"
    with ctrl_c_after(9):
        done = gonio("run", small, "--until", "albedo=0.02", "--budget-min", 30, "--out", folder)
    assert done.returncode == 4, done.stderr
    assert "until u(albedo) 0.02, at most 30 min, of 30 geometries" in done.stderr
    (listed,) = json.loads(gonio("runs", folder, "--json").stdout)["runs"]
    assert (listed["state"], listed["planned"]) == ("9 so far", None)
    resumed = gonio("resume", folder, "--yes")
    assert resumed.returncode == 0, resumed.stderr
    return folder, done.stderr + resumed.stderr + resumed.stdout


def test_each_batch_is_a_line_and_the_end_says_why(run: tuple[Path, str]) -> None:
    _, text = run
    assert re.search(r"batch 1: 8 for lack of fit\n", text)
    assert re.search(r"batch 3: .*lambert so far, u\(albedo\) \S+, wanted 0.02", text)
    assert re.search(r"end: the goal is reached: u\(albedo\) \S+, wanted 0.02", text)


def test_report_and_table_say_what_each_geometry_was_measured_for(run: tuple[Path, str]) -> None:
    folder, text = run
    with Record.open(folder) as record:
        points = sum(reading.kind == "point" for reading in record.readings())
        assert record.meta("steps") == str(len(record.readings()))
        assert batches_of(record.events())[-1].end
    with (folder / "measurements.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == points < 30
    assert {row["chosen_for"] for row in rows} <= {"lack of fit", "albedo", "other models"}
    said = r"the scan chose its geometries: 1\d for lack of fit.* It ended as the goal is reached"
    report = (folder / "report.html").read_text()
    assert re.search(said, report)
    for why in {row["chosen_for"] for row in rows}:
        assert f"measured for: {why}" in report
    assert re.search(said, re.sub(r"\s+", " ", text))


def test_the_run_is_complete_and_reported_again_as_it_was(run: tuple[Path, str]) -> None:
    folder, _ = run
    assert "complete" in gonio("runs", folder).stdout
    table = (folder / "measurements.csv").read_bytes()
    done = gonio("resume", folder)  # nobody is asked: nothing moves
    assert done.returncode == 0, done.stderr
    assert (folder / "measurements.csv").read_bytes() == table


def test_the_plan_of_a_protocol_with_a_goal_tells_the_first_batch(small: Path) -> None:
    path = small.with_name("goal.yaml")
    path.write_text(f"{small.read_text()}goal: {{albedo: {{u: 0.02}}}}\nbudget_min: 30\n")
    told = json.loads(gonio("plan", path, "--json").stdout)["adaptive"]
    assert (told["until"], told["budget_s"], told["candidates"]) == ({"albedo": 0.02}, 1800, 30)
    assert len(told["first_batch"]) == 8
    assert 0 < told["u_of_all_candidates"]["albedo"] < 0.02
    text = re.sub(r"\s+", " ", gonio("plan", path).stdout)
    assert "chooses its geometries until albedo=0.02, at most 30 min" in text
    assert "first batch, with references" in text
    path.write_text(path.read_text().replace("budget_min: 30", "budget_min: 0.1"))
    assert gonio("plan", path).returncode == 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--until", "sigma_deg=0.2"], "--until sigma_deg: no parameter .* allowed: albedo, k"),
        (["--until", "albedo=0"], "--until albedo: u 0; allowed: more than 0"),
        (["--until", "albedo=0.1", "--budget-min", 0.1], "budget of 0.1 min: the first batch"),
        (["--budget-min", 5], "--budget-min: allowed with --until"),
    ],
)
def test_a_wrong_goal_ends_with_2_before_anything_is_written(
    small: Path, tmp_path: Path, options: list[object], words: str
) -> None:
    done = gonio("run", small, *options, "--out", tmp_path / "run")
    assert done.returncode == 2
    assert re.search(words, re.sub(r"\s+", " ", done.stderr))
    assert not (tmp_path / "run").exists()
