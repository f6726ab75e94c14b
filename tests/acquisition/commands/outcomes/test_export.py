"""`gonio export`: what a run gives to other programs, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.results.sources import Wanted, read_source
from analysis.exchange.formats import FORMATS
from analysis.exchange.imports import READERS
from tests.support.command import finished_run
from tests.support.command import gonio_here as gonio
from tests.support.scans import small_demo


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exported")
    return finished_run(small_demo(folder, "lambert, oren_nayar"), folder / "run")


@pytest.mark.slow
def test_exports_of_one_name_into_one_folder_do_not_collide(
    run: Path, tmp_path: Path, slow: bool
) -> None:
    """A table of 1.5 million cells, whose two files are like those of the others, with --slow."""
    for name in ("astm", "pab", "radiance", "mitsuba", *["merl"] * slow):
        path = tmp_path / f"mine{FORMATS[name].suffix}"
        done = gonio("export", run, "--format", name, "-o", path)
        assert done.returncode == 0, done.stderr


def test_csv_is_the_table_of_the_run(run: Path, tmp_path: Path) -> None:
    done = gonio("export", run, "--format", "csv", "-o", tmp_path / "mine.csv")
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [str(tmp_path / "mine.csv")]
    assert (tmp_path / "mine.csv").read_bytes() == (run / "measurements.csv").read_bytes()


@pytest.mark.parametrize("name", READERS)
def test_a_table_for_another_program_holds_the_run_and_can_be_fitted(
    run: Path, tmp_path: Path, name: str
) -> None:
    path = tmp_path / f"mine{FORMATS[name].suffix}"
    done = gonio("export", run, "--format", name, "-o", path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[0] == str(path)
    assert all(Path(line).is_file() for line in done.stdout.split())
    theirs = read_source(path, Wanted()).measurements
    ours = read_source(run, Wanted()).measurements
    assert set(theirs.brdf) <= set(ours.brdf)
    assert theirs.size == np.sum(np.isin(ours.theta_i_deg, theirs.theta_i_deg))
    assert gonio("fit", path, "--models", "lambert").returncode == 0
    if (beside := path.with_suffix(f".{name}.u.csv")).exists():
        with_u = read_source(beside, Wanted()).measurements
        assert with_u.u_random is not None
        assert sorted(with_u.brdf) == sorted(ours.brdf)


@pytest.mark.parametrize("name", ["nexus", "merl", "mitsuba", "radiance"])
def test_the_model_of_a_run_is_exported(run: Path, tmp_path: Path, name: str) -> None:
    pytest.importorskip("h5py", reason="the library of NeXus files is not installed")
    path = tmp_path / f"mine{FORMATS[name].suffix}"
    done = gonio("export", run, "--format", name, "-o", path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[0] == str(path)
    assert {Path(line) for line in done.stdout.split()} == set(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("format_name", "file", "words"),
    [
        ("openmaterial", "mine_brdf.xompt", "state `metadata: wavelength_nm`"),
        ("radiance", "my paint.rad", "without spaces"),
        ("cvs", "mine.csv", "did you mean csv?"),
        ("excel", "mine.csv", "allowed: csv"),
        ("csv", "mine.txt", "must end in .csv"),
        ("csv", "mine", "must end in .csv"),
    ],
)
def test_a_wrong_format_or_name_writes_nothing(
    run: Path, tmp_path: Path, format_name: str, file: str, words: str
) -> None:
    done = gonio("export", run, "--format", format_name, "-o", tmp_path / file)
    assert done.returncode == 2
    assert words in " ".join(done.stderr.split())
    assert not list(tmp_path.iterdir())


def test_no_file_is_replaced_by_an_export_or_its_side_file(run: Path, tmp_path: Path) -> None:
    kept = tmp_path / "mine.merl.json"
    kept.write_text("mine")
    done = gonio("export", run, "--format", "merl", "-o", tmp_path / "mine.binary")
    assert done.returncode == 2
    assert "mine.merl.json: exists already" in " ".join(done.stderr.split())
    assert kept.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [kept]


def test_a_folder_that_is_no_run_is_named(tmp_path: Path) -> None:
    done = gonio("export", tmp_path, "--format", "csv", "-o", tmp_path / "mine.csv")
    assert done.returncode == 2
    assert str(tmp_path) in "".join(done.stderr.split())
    assert not list(tmp_path.iterdir())


def test_a_missing_folder_ends_with_its_name(run: Path, tmp_path: Path) -> None:
    done = gonio("export", run, "--format", "csv", "-o", tmp_path / "none" / "mine.csv")
    assert done.returncode == 3
    assert "none" in done.stderr


def test_the_help_names_every_format() -> None:
    helped = gonio("export", "--help").stdout
    assert [name for name in FORMATS if name not in helped] == []
