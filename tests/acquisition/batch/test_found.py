"""Sources in a folder: what is one, and what is not read."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from acquisition.batch.found import TABLES, runs_in, sources_in
from instrument.errors import InputError
from instrument.record.record import FILE_NAME


def _make(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()


def test_runs_and_tables_are_found_and_sorted_by_name(tmp_path: Path) -> None:
    run = f"b/run/{FILE_NAME}"
    _make(tmp_path, "z.CSV", "a.csv", run, "b/run/measurements.csv", "b/c/d.bsdf", "c.binary")
    found = sources_in(tmp_path)
    assert list(found.sources) == ["a.csv", "b/c/d.bsdf", "b/run", "c.binary", "z.CSV"]
    assert all(found.sources[name] == tmp_path / name for name in found.sources)
    assert found.others == ()


def test_files_of_one_pab_folder_are_one_table(tmp_path: Path) -> None:
    _make(tmp_path, "p/30.pab", "p/60.pab", "p/30.pab.u.csv", "p/other.csv")
    found = sources_in(tmp_path)
    assert list(found.sources) == ["p", "p/other.csv"]
    assert found.others == ("p/30.pab.u.csv",)


def test_what_is_hidden_or_behind_a_link_to_a_folder_is_not_searched(tmp_path: Path) -> None:
    _make(tmp_path, "a.csv", ".b/c.csv", ".d.csv", "notes.txt")
    (tmp_path / "circle").symlink_to(tmp_path)
    (tmp_path / "link.csv").symlink_to(tmp_path / "a.csv")
    found = sources_in(tmp_path)
    assert (list(found.sources), found.others) == (["a.csv", "link.csv"], ("notes.txt",))


@pytest.mark.parametrize("seed", range(5))
def test_every_file_is_a_source_or_named_as_none(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    endings = [*TABLES, ".txt", "", ".json", ".u.csv"]
    folders = ["", "a/", "a/b/", "c/"]
    names = {f"{rng.choice(folders)}{n}{rng.choice(endings)}" for n in range(20)}
    _make(tmp_path, *names)
    _make(tmp_path, "sure.csv")
    found = sources_in(tmp_path)
    assert {*found.sources, *found.others} == {*names, "sure.csv"}
    assert not {*found.sources} & {*found.others}


def test_nothing_to_fit_is_refused(tmp_path: Path) -> None:
    _make(tmp_path, "notes.txt")
    with pytest.raises(InputError, match=r"holds no run.*no table"):
        sources_in(tmp_path)
    with pytest.raises(InputError, match="no such folder"):
        sources_in(tmp_path / "absent")
    _make(tmp_path, FILE_NAME)
    with pytest.raises(InputError, match="is one run"):
        sources_in(tmp_path)


def test_runs_are_found_by_what_they_have_and_the_others_are_named(tmp_path: Path) -> None:
    rng = random.Random(9)
    names = {f"{rng.choice(['', 'a/', 'a/b/', 'c/'])}run{n}" for n in range(12)}
    wanted = set(rng.sample(sorted(names), 5))
    _make(tmp_path, "table.csv", "notes.txt", *(f"{name}/{FILE_NAME}" for name in names))
    found = runs_in(tmp_path, "map", lambda run: run.relative_to(tmp_path).as_posix() in wanted, "")
    assert list(found.sources) == sorted(wanted)
    assert all(found.sources[name] == tmp_path / name for name in wanted)
    assert list(found.others) == sorted(names - wanted)
    with pytest.raises(InputError, match=r"that has frames; without: .* and 9 more$"):
        runs_in(tmp_path, "map", lambda _: False, "frames")
    _make(tmp_path, FILE_NAME)
    with pytest.raises(InputError, match=f"is one run: gonio map {tmp_path}, without --all"):
        runs_in(tmp_path, "map", lambda _: True, "frames")
