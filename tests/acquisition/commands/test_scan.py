"""`gonio run`, `plan`, `resume` and `report`: files, exit codes and messages."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from acquisition.commands import scan
from instrument.record.record import Record
from tests.support.command import gonio_here as gonio
from tests.support.scans import TWO_MODELS, small_demo
from tests.support.terminal.ctrl_c import ctrl_c_after

METADATA = "{sample_id: F-17, operator: Jürgen, wavelength_nm: 550, notes: 'two, \"three\"'}"


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A protocol of two incidences and nine view angles, with metadata."""
    path = small_demo(tmp_path_factory.mktemp("protocol"), TWO_MODELS)
    path.write_text(f"{path.read_text()}metadata: {METADATA}\n")
    return path


@pytest.fixture(scope="module")
def run(
    small: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """The folder of a run, and its output."""
    folder = tmp_path_factory.mktemp("runs") / "run"
    done = gonio("run", small, "--out", folder)
    assert done.returncode == 0, done.stderr
    return folder, done


@pytest.fixture(scope="module")
def finished(run: tuple[Path, subprocess.CompletedProcess[str]]) -> Path:
    return run[0]


@pytest.fixture(scope="module")
def stopped(small: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run stopped with Ctrl-C after some readings: copy it before changing it."""
    folder = tmp_path_factory.mktemp("stopped") / "run"
    with ctrl_c_after(6):
        done = gonio("run", small, "--out", folder)
    assert done.returncode == 4, done.stderr
    assert f"gonio resume {folder}" in done.stderr
    assert not (folder / "record.sqlite-wal").exists()  # the record was closed in order
    return folder


@pytest.fixture(scope="module")
def relative(
    small: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """A run without a white tile: its folder and its output."""
    folder = tmp_path_factory.mktemp("relative")
    protocol = folder / "relative.yaml"
    protocol.write_text(re.sub(r"  white_tile:.*\n", "", small.read_text()))
    return folder / "run", gonio("run", protocol, "--out", folder / "run")


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "measurements.csv").open() as file:
        return list(csv.DictReader(file))


def test_a_run_leaves_the_documented_files(finished: Path) -> None:
    assert {p.name for p in finished.iterdir()} >= {
        "record.sqlite", "protocol.yaml", "rig.yaml", "measurements.csv", "fit.json", "report.html",
    }  # fmt: skip
    header = (finished / "measurements.csv").read_text().splitlines()[0]
    assert header.startswith(
        "theta_i_deg,theta_r_deg,dphi_deg,radiance,u_radiance,brdf,u_brdf,"
        "window_pixels,exposure_s,frames,flags,time_utc"
    )
    table = rows(finished)
    assert len(table) == 18 - 1  # (60, 60) is hidden by the lamp
    assert {float(row["theta_r_deg"]) for row in table} >= {-80.0, 0.0, 80.0}
    assert all(0 < float(row["u_brdf"]) < 0.1 * float(row["brdf"]) for row in table)


def test_record_table_and_report_hold_the_metadata_of_the_protocol(finished: Path) -> None:
    facts = {"sample_id": "F-17", "operator": "Jürgen", "wavelength_nm": "550"}
    facts["notes"] = 'two, "three"'
    with Record.open(finished) as record:
        assert {name: record.meta(name) for name in facts} == facts
        assert record.meta("filter") is None
    assert all(row | facts == row for row in rows(finished))
    assert "filter" not in rows(finished)[0]
    report = (finished / "report.html").read_text()
    for text in ("sample id", "wavelength (nm)", "Jürgen", "two, &quot;three&quot;"):
        assert f">{text}<" in report


def test_fit_json_has_the_documented_keys(finished: Path) -> None:
    fit = json.loads((finished / "fit.json").read_text())
    assert set(fit) >= {"chosen", "verdict", "candidates"}
    assert fit["chosen"] in {c["model"] for c in fit["candidates"]}
    assert fit["verdict"] in {"adequate", "none adequate", "not identifiable"}
    for candidate in fit["candidates"]:
        assert set(candidate) >= {
            "model", "parameters", "rms_relative", "reduced_chi2", "bic", "converged",
        }  # fmt: skip
        for parameter in candidate["parameters"].values():
            assert parameter["u"] is not None or len(parameter["interval"]) == 2


def test_the_outcome_names_the_model_and_the_report(
    run: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    folder, done = run
    assert "oren_nayar+torrance_sparrow" in done.stdout
    assert re.search(r"sigma_deg\s.*±", done.stdout)
    assert str(folder / "report.html") in done.stdout


def test_json_is_alone_on_standard_output(finished: Path, tmp_path: Path, small: Path) -> None:
    for done in (
        gonio("report", finished, "--json"),
        gonio("run", small, "--out", tmp_path / "run", "--json"),
    ):
        assert done.returncode == 0
        assert json.loads(done.stdout)["chosen"] == "oren_nayar+torrance_sparrow"
    assert gonio("plan", small, "--json").stdout.startswith("{")


def test_the_plan_is_printed_and_nothing_is_written(small: Path, tmp_path: Path) -> None:
    done = gonio("plan", small, cwd=tmp_path)
    assert done.returncode == 0
    for words in ("17 to measure", "1 where camera and lamp hide one another", "about"):
        assert words in done.stdout
    assert not list(tmp_path.iterdir())


def test_out_is_refused_unless_absent_or_empty(finished: Path, small: Path) -> None:
    before = sorted(p.name for p in finished.iterdir())
    done = gonio("run", small, "--out", finished)
    assert done.returncode == 2
    assert "must be absent or an empty folder" in done.stderr
    assert sorted(p.name for p in finished.iterdir()) == before


def test_every_mistake_in_a_file_is_reported_at_once_and_nothing_moves(
    small: Path, tmp_path: Path
) -> None:
    text = small.read_text().replace("num: 9", "num: 0").replace("ks: 0.076", "kz: 0.076")
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text(text + "hurry: true\n")
    done = gonio("run", wrong, "--out", tmp_path / "run")
    assert done.returncode == 2
    lines = done.stderr.splitlines()
    assert all(re.match(rf"{re.escape(str(wrong))}:\d+:\d+: ", line) for line in lines)
    for words in ("theta_r_deg.num", "kz", "hurry"):
        assert sum(words in line for line in lines) == 1, done.stderr
    assert not (tmp_path / "run").exists()


# For SIGTERM see `tests/system/test_emulated.py`.
def test_a_stopped_scan_names_the_command_that_resumes_it(
    stopped: Path, finished: Path, tmp_path: Path
) -> None:
    folder = shutil.copytree(stopped, tmp_path / "run")
    resumed = gonio("resume", folder, "--yes")
    assert resumed.returncode == 0, resumed.stderr
    again, whole = rows(folder), rows(finished)
    key = [(r["theta_i_deg"], r["dphi_deg"], r["theta_r_deg"]) for r in again]
    assert key == [(r["theta_i_deg"], r["dphi_deg"], r["theta_r_deg"]) for r in whole]
    for a, b in zip(again, whole, strict=True):
        assert float(a["brdf"]) == pytest.approx(float(b["brdf"]), rel=2e-3)


def test_resume_needs_permission_to_move(stopped: Path) -> None:
    done = gonio("resume", stopped)
    assert done.returncode == 2
    assert "--yes" in done.stderr


def test_a_finished_run_is_reported_again(finished: Path) -> None:
    before = (finished / "measurements.csv").read_text()
    (finished / "report.html").unlink()
    done = gonio("resume", finished)
    assert done.returncode == 0
    assert (finished / "report.html").exists()
    assert (finished / "measurements.csv").read_text() == before


def test_a_run_with_a_changed_protocol_is_not_resumed(finished: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(finished, copy)
    path = copy / "protocol.yaml"
    path.write_text(path.read_text().replace("num: 9", "num: 11"))
    done = gonio("resume", copy, "--yes")
    assert done.returncode == 2
    assert "changed since the run began" in done.stderr


@pytest.mark.parametrize("command", ["resume", "report"])
def test_a_folder_without_a_run_is_named(command: str, tmp_path: Path) -> None:
    done = gonio(command, tmp_path)
    assert done.returncode == 2
    assert f"{tmp_path}: no record.sqlite there" in done.stderr


def test_without_a_white_tile_only_the_shape_is_determined(
    relative: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    folder, done = relative
    assert done.returncode == 5, done.stderr
    assert "do not determine albedo" in " ".join(done.stdout.split())
    assert all(row["brdf"] == "" and float(row["radiance"]) > 0 for row in rows(folder))
    fit = json.loads((folder / "fit.json").read_text())
    assert fit["verdict"] == "not identifiable"
    found = next(c for c in fit["candidates"] if c["model"] == fit["chosen"])["parameters"]
    assert found["albedo"]["u"] is None
    assert abs(found["sigma_deg"]["value"] - 20) < 4 * found["sigma_deg"]["u"]
    assert "radiance is relative" in (folder / "report.html").read_text()


def test_without_a_white_tile_the_strength_of_the_lobe_is_known_beside_the_diffuse_part(
    relative: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    """ks/albedo with u in fit.json, in the printed table and in the report; k_s/k_d explained."""
    folder, done = relative
    fit = json.loads((folder / "fit.json").read_text())
    (glossy,) = (c for c in fit["candidates"] if c["model"] == "oren_nayar+torrance_sparrow")
    ratio = glossy["ratios"]["ks/albedo"]
    assert abs(ratio["value"] - 0.076 / 0.80) < 4 * ratio["u"] < 0.02
    words = "k_s/k_d as in Oren and Nayar (1995), whose lobe (37) leaves out the factor 1/4"
    printed = " ".join(done.stdout.split())
    fitted = " ".join(gonio("fit", folder).stdout.split())
    for shown in (printed, fitted, (folder / "report.html").read_text()):
        assert "ks/albedo" in shown
        assert words in shown


def test_a_stopped_run_is_reported_as_unfinished(stopped: Path, tmp_path: Path) -> None:
    shutil.copytree(stopped, tmp_path / "run")
    done = gonio("report", tmp_path / "run")
    assert done.returncode in (0, 5), done.stderr
    assert "Traceback" not in done.stderr
    assert f"gonio resume {tmp_path / 'run'}" in done.stdout + done.stderr


def test_a_ctrl_c_after_the_scan_loses_nothing_and_names_the_command_to_report(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    folder = tmp_path / "run"
    with monkeypatch.context() as while_fitting:
        while_fitting.setattr("acquisition.results.finish.fit_run", interrupted)
        stopped = gonio("run", small, "--out", folder)
    assert stopped.returncode == 4
    assert re.search(r"Nothing measured is lost: 2\d readings are safe in", stopped.stderr)
    assert f"gonio report {folder}" in stopped.stderr
    assert not (folder / "fit.json").exists()
    assert gonio("report", folder).returncode == 0
    assert (folder / "fit.json").exists()


def test_permission_to_move_is_asked_with_the_reason_of_the_stop_and_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(scan, "require_yes", lambda question, *_: asked.append(question))
    with Record.create(tmp_path / "run", {}) as record:
        record.add_event("2026", "fault", "theta_r: stalled at 12 deg")
        scan._confirm(False, 9, record)
        scan._confirm(True, 9, record)
        said = [text for _, kind, text in record.events() if kind == "resumed"]
    assert len(asked) == 1
    assert "The scan ended with: theta_r: stalled at 12 deg" in asked[0]
    assert "9 readings are missing or doubtful. Is the rig clear" in asked[0]
    assert said == [
        "the rig may move: yes, asked at the terminal",
        "the rig may move: --yes",
    ]


@pytest.mark.parametrize(
    ("kinds", "words"),
    [
        ([], "ended without a word"),
        (["stopped", "resumed"], "ended without a word"),
        (["resumed", "stopped"], "The scan ended with: why"),
        (["stopped", "resumed", "finished"], "^9 readings"),
    ],
)
def test_a_resume_says_how_the_scan_ended_also_where_no_word_of_it_was_left(
    kinds: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(scan, "require_yes", lambda question, *_: asked.append(question))
    with Record.create(tmp_path / "run", {}) as record:
        for kind in kinds:
            record.add_event("2026", kind, "why")
        scan._confirm(False, 9, record)
    assert re.search(words, asked[0])


def test_a_protocol_and_a_run_whose_names_are_no_utf_8(tmp_path: Path) -> None:
    protocol = tmp_path / os.fsdecode(b"pr\xff.yaml")
    small_demo(tmp_path, TWO_MODELS).rename(protocol)
    run = tmp_path / os.fsdecode(b"run\xfe")
    done = gonio("run", protocol, "--out", run)
    assert done.returncode == 0, done.stderr
    assert gonio("report", run).returncode == 0
    assert {path.name for path in run.iterdir()} >= {"record.sqlite", "report.html", "fit.json"}
