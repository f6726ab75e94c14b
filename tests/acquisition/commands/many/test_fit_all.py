"""`gonio fit --all`: each result as of the source alone, failures told, Ctrl-C in the middle."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.batch.tables import BAD, MODELS, write_tables
from tests.support.command import gonio_here as gonio
from tests.support.paths import ROOT
from tests.support.timing.deadline import wait_for


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tables(tmp_path_factory.mktemp("many") / "in", seed=7)


@pytest.fixture(scope="module")
def out(folder: Path) -> Path:
    return folder.parent / "out"


@pytest.fixture(scope="module")
def done(folder: Path, out: Path) -> subprocess.CompletedProcess[str]:
    return gonio("fit", "--all", folder, "--models", MODELS, "--out", out, "--json")


def test_each_result_is_that_of_the_source_alone(
    folder: Path, out: Path, done: subprocess.CompletedProcess[str], tmp_path: Path
) -> None:
    """Bit for bit, in the JSON and in the files."""
    found = json.loads(done.stdout)
    assert found["complete"]
    names = [result["source"] for result in found["results"]]
    assert names == sorted(names)
    for result in found["results"]:
        name, files = result["source"], tmp_path / result["source"]
        files.parent.mkdir(exist_ok=True)
        alone = gonio("fit", folder / name, "--models", MODELS, "--json", "--out", files)
        assert result["exit_code"] == alone.returncode
        assert json.dumps(result["fit"]) == (alone.stdout.strip() or "null")
        assert _contents(out / "fits" / name) == _contents(files)


def _contents(folder: Path) -> dict[str, bytes]:
    """Files by name; of the report, which has no charts where a test makes it, the name alone."""
    files = {path.name: path for path in folder.glob("*")}
    return {n: b"" if n == "report.html" else path.read_bytes() for n, path in files.items()}


def test_one_bad_file_ends_no_other_and_sets_the_exit_code(
    folder: Path, done: subprocess.CompletedProcess[str]
) -> None:
    results = {r["source"]: r for r in json.loads(done.stdout)["results"]}
    assert done.returncode == 2
    assert {name: r["exit_code"] for name, r in results.items() if r["exit_code"]} == {
        BAD: 2, "undetermined.csv": 5,
    }  # fmt: skip
    assert "dphi_deg" in results[BAD]["message"]
    assert f"2 of {len(results)} without a result: {BAD}" in done.stderr


def test_a_log_has_one_line_for_each_source(done: subprocess.CompletedProcess[str]) -> None:
    results = json.loads(done.stdout)["results"]
    lines = done.stderr.splitlines()[: len(results)]
    numbers, rest = zip(*(line.split(" ", 1) for line in lines), strict=True)
    assert list(numbers) == [f"{n}/{len(results)}" for n in range(1, len(results) + 1)]
    assert sorted(text.split(":")[0] for text in rest) == [r["source"] for r in results]


def test_the_table_has_the_numbers_of_the_fits(
    out: Path, done: subprocess.CompletedProcess[str]
) -> None:
    with (out / "summary.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    results = json.loads(done.stdout)["results"]
    assert [row["source"] for row in rows] == [r["source"] for r in results]
    for row, result in zip(rows, results, strict=True):
        assert row["exit_code"] == str(result["exit_code"])
        fit = result["fit"] or {"chosen": None, "candidates": []}
        chosen = [c for c in fit["candidates"] if c["model"] == fit["chosen"]]
        for name, estimate in chosen[0]["parameters"].items() if chosen else ():
            assert float(row[name]) == estimate["value"]
            assert row[f"u_{name}"] == ("" if estimate["u"] is None else repr(estimate["u"]))


def test_a_person_reads_a_table_with_the_reasons_below(folder: Path) -> None:
    (folder / "notes.txt").touch()
    done = gonio("fit", "--all", folder, "--models", "lambert", "--workers", 1)
    (folder / "notes.txt").unlink()
    text = " ".join(done.stdout.split())
    for words in ("source model verdict", f"{BAD} — failed", f"- {BAD}: ", "sub/matt.csv lambert"):
        assert words in text
    assert "neither run nor table: notes.txt" in text


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--models", "lambrt"], "--models"),
        (["--format", "csv"], "allowed with --all: auto"),
        (["--sample", 3], "--sample"),
        (["--repeats", "median"], "allowed: mean"),
        (["--workers", 1, "--scheduler", "tcp://127.0.0.1:1"], "--workers"),
        (["--workers", 0], "--workers"),
    ],
)
def test_a_wrong_option_is_refused_before_any_fit(
    folder: Path, options: list[object], words: str
) -> None:
    done = gonio("fit", "--all", folder, *options)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr


def test_options_of_many_need_all(folder: Path) -> None:
    done = gonio("fit", folder / "rough.csv", "--workers", 2)
    assert done.returncode == 2
    assert "--workers" in done.stderr


def test_the_new_folder_is_not_among_the_sources(folder: Path) -> None:
    done = gonio("fit", "--all", folder, "--out", folder / "fits")
    assert done.returncode == 2
    assert "elsewhere" in done.stderr


def test_a_stop_keeps_what_is_done_and_leaves_no_process(folder: Path, tmp_path: Path) -> None:
    """A table that is a pipe without a writer is read for ever."""
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.csv").write_bytes((folder / "rough.csv").read_bytes())
    os.mkfifo(tmp_path / "in" / "b.csv")
    command = ["fit", "--all", tmp_path / "in", "--out", tmp_path / "out", "--models", "lambert"]
    with subprocess.Popen(
        [sys.executable, "-m", "acquisition", *map(str, command), "--workers", "2"],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    ) as main:  # fmt: skip
        assert main.stderr is not None
        assert main.stderr.readline().startswith("1/2 a.csv")
        os.killpg(main.pid, signal.SIGINT)  # as the terminal does
        printed, errors = main.communicate(timeout=60)
    assert main.returncode == 4
    assert "stopped by the operator: 1 of 2 done" in errors
    assert "a.csv" in printed
    assert "b.csv" not in (tmp_path / "out" / "summary.csv").read_text()
    written = sorted(path.name for path in (tmp_path / "out").rglob("*") if path.is_file())
    assert written == ["fit.json", "measurements.csv", "report.html", "summary.csv"]
    wait_for(lambda: not _group(main.pid), "no process is left")


def _group(number: int) -> bool:
    try:
        os.killpg(number, 0)
    except ProcessLookupError:
        return False
    return True


def test_without_the_extra_a_scheduler_is_refused_in_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    done = gonio("fit", "--all", folder, "--scheduler", "tcp://127.0.0.1:8786")
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert "pip install 'gonio[cluster]'" in done.stderr
