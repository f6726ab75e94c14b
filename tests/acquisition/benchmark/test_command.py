"""Command `gonio bench`: the files it writes and the folders it refuses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from acquisition.benchmark.command import run_benchmark
from acquisition.benchmark.result import MapPicture
from tests.support.benchmark import from_json, result
from tests.support.command import gonio_here


def made_up_maps() -> Iterator[MapPicture]:
    yield MapPicture(
        title="Where it fails",
        caption="Read this.\nAnd this.",
        svg='<?xml version="1.0"?>\n<svg xmlns="http://www.w3.org/2000/svg"><g/></svg>',
        columns={"theta_deg": [10.0, 20.0], "fails": ["no", "yes"]},
    )


def test_the_command_writes_all_files_with_maps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    studies = result().studies
    monkeypatch.setattr("acquisition.benchmark.maps.all_maps.draw_maps", made_up_maps)
    monkeypatch.setattr(
        "acquisition.benchmark.corrections.picture.corrections_picture",
        lambda benches: replace(next(made_up_maps()), caption=f"{benches} benches"),
    )
    monkeypatch.setattr(
        "acquisition.benchmark.studies.all_studies.studies", lambda *_: iter(studies)
    )
    folder = tmp_path / "bench"
    run_benchmark(folder, quick=True, with_maps=True)
    assert {p.name for p in folder.iterdir()} == {
        "bench.html", "bench.json", "main_chart.svg", "map_1.csv", "map_2.csv",
        *(f"{one.name}.csv" for one in studies),
    }  # fmt: skip
    assert (folder / "map_1.csv").read_text() == "theta_deg,fails\n10,no\n20,yes\n"
    written = (folder / "bench.html").read_text()
    assert "Where it fails" in written
    assert "2 benches" in written
    assert "Read this.<br>And this." in written
    assert "<?xml" not in written
    assert from_json((folder / "bench.json").read_text()).effort == "quick"
    ElementTree.parse(folder / "main_chart.svg")


def test_a_folder_that_is_not_empty_is_refused(tmp_path: Path) -> None:
    (tmp_path / "kept.txt").write_text("mine")
    for wrong in (tmp_path, tmp_path / "kept.txt"):
        done = gonio_here("bench", "--quick", "--out", wrong)
        assert done.returncode == 2
        assert f"{wrong}: --out must be absent or an empty folder" in done.stderr
    assert {p.name for p in tmp_path.iterdir()} == {"kept.txt"}


def test_the_folder_must_be_named() -> None:
    done = gonio_here("bench")
    assert done.returncode == 2
    assert "--out" in done.stderr
