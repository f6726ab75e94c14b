"""Bits that flip in a run's record: the reading is named, left out by a report, measured again."""

from __future__ import annotations

import csv
import json
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from instrument.errors import InputError
from instrument.record.record import FILE_NAME, Record
from tests.support.command import gonio_here as gonio
from tests.support.storage.bit_flips import flips
from tests.support.strangers.run_folders import run_few_points


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_few_points(tmp_path_factory.mktemp("run"))


@pytest.fixture
def damaged(run: Path, tmp_path: Path) -> tuple[Path, int]:
    """A copy of the run in which the signal of one point is not as it was written; its step."""
    shutil.copytree(run, tmp_path / "damaged")
    with closing(sqlite3.connect(tmp_path / "damaged" / FILE_NAME)) as database:
        (step,) = database.execute(
            "UPDATE reading SET signal_dn = 1.5 * signal_dn WHERE step = "
            "(SELECT MIN(step) + 1 FROM reading WHERE kind = 'point') RETURNING step"
        ).fetchone()
        database.commit()
    return tmp_path / "damaged", step


def rows(run: Path) -> dict[tuple[str, ...], float]:
    """BRDF in 1/sr by angles."""
    with (run / "measurements.csv").open(newline="") as file:
        angles = ("theta_i_deg", "theta_r_deg", "dphi_deg")
        return {tuple(r[name] for name in angles): float(r["brdf"]) for r in csv.DictReader(file)}


def test_a_report_leaves_the_reading_out_and_says_so(run: Path, damaged: tuple[Path, int]) -> None:
    folder, step = damaged
    done = gonio("report", folder)
    assert done.returncode == 0, done.stderr
    said = f"damaged on the disk since they were written, and left out: reading {step}"
    assert said in " ".join(done.stdout.split())
    assert said in (folder / "report.html").read_text()
    left, whole = rows(folder), rows(run)
    assert len(left) == len(whole) - 1
    assert left == {key: whole[key] for key in left}
    fitted = json.loads(gonio("fit", folder, "--json").stdout)
    assert [n["text"] for n in fitted["notes"] if n["code"] == "damaged"] == [said]


def test_a_resume_measures_the_reading_again(run: Path, damaged: tuple[Path, int]) -> None:
    folder, step = damaged
    done = gonio("resume", folder, "--yes")
    assert done.returncode == 0, done.stderr
    assert f"reading {step}; readings are measured again" in " ".join(done.stderr.split())
    again, whole = rows(folder), rows(run)
    assert list(again) == list(whole)
    assert list(again.values()) == pytest.approx(list(whole.values()), rel=3e-3)
    with Record.open(folder) as record:
        assert record.damaged() == ()
        assert any(f"reading {step}" in text for _, kind, text in record.events() if kind)


@pytest.mark.slow
def test_no_bit_of_a_real_record_flips_in_silence(run: Path, tmp_path: Path, slow: bool) -> None:
    """Each reading is as written, or named, or the record is refused by name."""
    shutil.copytree(run, tmp_path / "run")
    with Record.open(run) as record:
        whole = {r.step: repr(r) for r in record.readings()}
        checks = record.checks()
    path, named, refused = tmp_path / "run" / FILE_NAME, 0, list[str]()
    data = path.read_bytes()
    for spoilt, _ in zip(flips(data, 61), range(4000 if slow else 60), strict=False):
        for end in ("-wal", "-shm"):
            Path(f"{path}{end}").unlink(missing_ok=True)
        path.write_bytes(spoilt)
        try:
            with Record.open(path.parent) as record:
                found = {r.step: repr(r) for r in record.readings()}
                missing = len(whole) - len(found)
                assert found.items() <= whole.items()
                assert record.checks() == checks
                assert sum("reading" in row for row in record.damaged()) == missing
                named += bool(record.damaged())
        except InputError as error:
            refused.append(str(error))
    assert named > 0
    assert all(text.startswith(str(path.parent)) for text in refused)
