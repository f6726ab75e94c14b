"""`gonio map --all`: each map as of the run alone, failures told, and what a stop leaves."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from acquisition.batch.summary import Outcome
from acquisition.commands.many import each_source
from tests.support.batch.runs import (
    CELL_MM,
    CELLS,
    DAMAGED,
    FRAMES,
    WITHOUT,
    Mapped,
    contents,
    copied,
    mapped_together,
)
from tests.support.command import gonio_here as gonio

Named = tuple[str, Path]


@pytest.fixture
def folder(measured: Path, tmp_path: Path) -> Path:
    return copied(measured, (FRAMES, CELLS, WITHOUT, DAMAGED), tmp_path / "in")


@pytest.fixture
def plain_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages without charts, which take most of the time of a small map."""
    page = "acquisition.commands.outcomes.map.map_html"
    monkeypatch.setattr(page, lambda *_: "<html></html>")


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in the test's own process, which saves the start of others."""

    def one_by_one(
        work: Callable[[Named], Outcome], items: Sequence[Named], workers: int
    ) -> Iterator[tuple[Named, Outcome]]:
        assert workers > 0
        yield from ((item, work(item)) for item in items)

    monkeypatch.setattr(each_source, "on_processes", one_by_one)


def test_each_map_is_that_of_the_run_alone(
    measured: Path, alone: dict[str, Mapped], tmp_path: Path
) -> None:
    """Bit for bit, in the JSON and in the files; a damaged run ends no other."""
    found = mapped_together(measured, tmp_path, "--workers", 2)
    assert list(found) == sorted(alone)
    assert found == alone
    assert [own.exit_code for own in found.values()] == [2, 0]
    assert list(found[FRAMES].files) == ["map.npz", "map.html", "map.nxs", "report.html"]


@pytest.mark.usefixtures("here", "plain_page")
def test_a_person_reads_a_table_with_the_reasons_below(folder: Path) -> None:
    (folder / FRAMES / "map.npz").mkdir()  # a place where no file can be written
    done = gonio("map", "--all", folder, "--cell-mm", CELL_MM)
    assert done.returncode == 3
    text = " ".join(done.stdout.split())
    for words in (
        "source model cells albedo sigma_deg varies in rejected",
        f"{DAMAGED} failed",
        f"{FRAMES} failed",
        f"{CELLS} oren_nayar {CELL_MM:g} mm 0.",
        f"- {DAMAGED}: ",
        "map.npz: cannot be written",
        f"{CELLS}: the fit of the run chose a model that cannot be mapped: oren_nayar is",
        f"not mapped, as their folders have neither frames nor cells: {WITHOUT}",
    ):
        assert words in text
    log = done.stderr.splitlines()
    assert [line.split(":")[0] for line in log[:3]] == [
        f"1/3 {DAMAGED}", f"2/3 {CELLS}", f"3/3 {FRAMES}",
    ]  # fmt: skip
    assert "oren_nayar, " in log[1]
    assert log[3] == f"2 of 3 without a result: {DAMAGED}, {FRAMES}"


@pytest.mark.usefixtures("plain_page")
def test_a_stop_keeps_the_maps_that_are_done(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(
        work: Callable[[Named], Outcome], items: Sequence[Named], workers: int
    ) -> Iterator[tuple[Named, Outcome]]:
        yield items[1], work(items[1])
        raise KeyboardInterrupt

    monkeypatch.setattr(each_source, "on_processes", stopped)
    done = gonio("map", "--all", folder, "--cell-mm", CELL_MM, "--json")
    assert done.returncode == 4
    assert done.stderr.endswith("stopped by the operator: 1 of 3 done\n")
    found = json.loads(done.stdout)
    assert (found["complete"], len(found["results"])) == (False, 1)
    name = found["results"][0]["source"]
    files = [folder / name / file for file in ("map.npz", "map.html")]
    assert found["results"][0]["map"]["files"] == [str(path) for path in files]
    assert sorted(folder.rglob("map.*")) == sorted(files)
    kept = contents(folder / name)
    assert gonio("map", folder / name, "--cell-mm", CELL_MM).returncode == 0
    assert contents(folder / name) == kept


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--all", "--model", "ggx"], "--model: ggx; allowed for a map: oren_nayar, "),
        (["--all", "--workers", 1, "--scheduler", "tcp://127.0.0.1:1"], "--workers: for processes"),
        (["--workers", 2], "--workers: for many sources at once; allowed with --all"),
        (["--scheduler", "tcp://127.0.0.1:1"], "--scheduler: for many sources at once"),
    ],
)
def test_a_wrong_option_is_refused_before_any_map(
    measured: Path, arguments: list[object], words: str
) -> None:
    done = gonio("map", measured, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr


def test_folders_without_runs_to_map_are_refused(measured: Path, tmp_path: Path) -> None:
    for folder, words in (
        (measured / WITHOUT, f"is one run: gonio map {measured / WITHOUT}, without --all"),
        (tmp_path / "absent", "no such folder; name the one that holds runs"),
        (tmp_path, "holds no run, which is a folder with record.sqlite, that has kept frames"),
    ):
        done = gonio("map", "--all", folder)
        assert (done.returncode, done.stdout) == (2, "")
        assert words in done.stderr
    copied(measured, [WITHOUT], tmp_path)
    assert f"; without: {WITHOUT}\n" in gonio("map", "--all", tmp_path).stderr
