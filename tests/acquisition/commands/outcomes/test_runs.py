"""`gonio runs`: every run of a folder is listed, whatever is wrong with some of them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from instrument.record.record import FILE_NAME
from tests.support.command import finished_run
from tests.support.command import gonio_here as gonio
from tests.support.scans import small_demo


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run, the same without its fit, one with a foreign fit, and two that are none."""
    folder = tmp_path_factory.mktemp("runs")
    protocol = small_demo(tmp_path_factory.mktemp("protocol"), "lambert, oren_nayar")
    finished_run(protocol, folder / "finished")
    for name in ("unfitted", "foreign"):
        shutil.copytree(folder / "finished", folder / name)
    (folder / "unfitted" / "fit.json").unlink()
    (folder / "foreign" / "fit.json").write_text('{"chosen": ["\\u001b[31m"], "verdict": 7}')
    (folder / "damaged").mkdir()
    (folder / "damaged" / FILE_NAME).write_bytes(b"no database" * 100)
    (folder / "notes").mkdir()
    return folder


def test_every_run_is_listed_with_its_state_and_verdict(folder: Path) -> None:
    done = gonio("runs", folder, "--json")
    assert done.returncode == 0, done.stderr
    found = {run["run"]: run for run in json.loads(done.stdout)["runs"]}
    assert set(found) == {"finished", "unfitted", "foreign", "damaged"}
    fit = json.loads((folder / "finished" / "fit.json").read_text())
    assert (found["finished"]["model"], found["finished"]["verdict"]) == (
        fit["chosen"],
        fit["verdict"],
    )
    assert {name: run["state"] for name, run in found.items()} == {
        **dict.fromkeys(("finished", "unfitted", "foreign"), "complete"),
        "damaged": "unreadable",
    }
    for name in ("unfitted", "foreign"):
        assert (found[name]["model"], found[name]["verdict"]) == (None, None)
    assert FILE_NAME in found["damaged"]["refused"]


def test_the_table_names_what_cannot_be_read_and_why(folder: Path) -> None:
    done = gonio("runs", folder)
    assert done.returncode == 0, done.stderr
    table, _, below = done.stdout.partition("- damaged:")
    assert [word for word in ("finished", "unfitted", "foreign") if word not in table] == []
    assert "record" in below
    assert "\x1b" not in done.stdout


def test_a_run_itself_is_listed(folder: Path) -> None:
    found = json.loads(gonio("runs", folder / "finished", "--json").stdout)["runs"]
    assert [run["run"] for run in found] == ["finished"]


@pytest.mark.parametrize("name", ["notes", "missing"])
def test_a_folder_without_runs_is_refused(folder: Path, name: str) -> None:
    done = gonio("runs", folder / name)
    assert done.returncode == 2
    assert name in done.stderr
