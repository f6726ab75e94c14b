"""`gonio compare`: days of one sample agree, another sample does not, wrong sources are named."""

from __future__ import annotations

import csv
import json
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from acquisition.commands.outcomes import compare
from analysis.choice.choice import choose
from tests.support.command import finished_run
from tests.support.command import gonio_here as gonio
from tests.support.scans import TWO_MODELS, small_demo

TILE = re.compile(r"white_tile: .*")
EXACT_TILE = "white_tile: {reflectance: 0.99, u_reflectance: 0.0, theta_r_deg: 10.0}"


def measured(folder: Path, seed: int, **changes: str) -> Path:
    """Run of a day: of the tile, whose true value a seed draws, nothing is uncertain here."""
    folder.mkdir()
    protocol = small_demo(folder, TWO_MODELS)
    rig = folder / "small_rig.yaml"
    rig.write_text(re.sub(r"seed: \d+", f"seed: {seed}", rig.read_text()))
    text = TILE.sub(EXACT_TILE, protocol.read_text()).replace("mottling: 0.02", "mottling: 0.0")
    for old, new in changes.items():
        text = re.sub(rf"{old}: [\d.]+", f"{old}: {new}", text)
    protocol.write_text(text)
    return finished_run(protocol, folder / "run")


@pytest.fixture(scope="module")
def days(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("days")
    return [measured(folder / f"day{seed}", seed) for seed in (1, 2)]


@pytest.fixture(autouse=True)
def few_models(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fit the samples' own model and its diffuse part; with --slow the first test fits all."""
    first = request.function is test_days_of_one_sample_agree
    if not (first and request.config.getoption("--slow")):
        models = ["oren_nayar", "oren_nayar+torrance_sparrow"]
        monkeypatch.setattr(compare, "choose", partial(choose, models=models))


@pytest.mark.slow
def test_days_of_one_sample_agree(days: list[Path]) -> None:
    done = gonio("compare", *days, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["agree"]
    assert found["agree_in_shape"]
    assert found["same_white_tile"]
    assert found["dof"] == len(found["geometries"]["theta_r_deg"])
    for run in found["runs"][1:]:
        assert abs(run["level"] - 1) < 4 * run["u_level"]
        assert run["u_level"] < 0.002


def test_another_sample_is_told_by_its_level(days: list[Path], tmp_path: Path) -> None:
    other = measured(tmp_path / "other", 4, albedo="0.78", ks="0.074")
    done = gonio("compare", days[0], other, "--json")
    found = json.loads(done.stdout)
    assert not found["agree"]
    assert found["runs"][1]["level"] == pytest.approx(0.975, abs=0.003)


def test_text_and_page_say_what_was_found(days: list[Path], tmp_path: Path) -> None:
    page = tmp_path / "days.html"
    done = gonio("compare", *days, "--out", page)
    assert done.returncode == 0, done.stderr
    assert "agree within their uncertainty" in done.stdout
    assert "its certificate cancel" in " ".join(done.stdout.split())
    html = page.read_text()
    assert "agree within their uncertainty" in html
    assert html.count("<svg") == 1
    assert "<script" not in html


def test_a_run_and_its_table_are_the_same(days: list[Path]) -> None:
    done = gonio("compare", days[0], days[0] / "measurements.csv", "--json")
    found = json.loads(done.stdout)
    assert found["chi2"] == pytest.approx(0, abs=1e-6)
    assert found["repeatability"]["scatter_relative"] == 0


def relative_table(run: Path, path: Path, *, matt: bool = False) -> Path:
    """The run's table as without a white tile: a level of its own for each incidence.

    matt: the values of Lambert's law stand in it.
    """
    with (run / "measurements.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    levels = np.random.default_rng(3).uniform(20, 4000, 99).tolist()
    for row in rows:
        radiance = 1.0 if matt else float(row["radiance"])
        radiance *= levels[int(float(row["theta_i_deg"]))]
        row |= {"brdf": "", "u_brdf": "", "radiance": repr(radiance)}
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return path


@pytest.mark.parametrize(("first", "agree"), [(0, True), (1, False)])
def test_a_relative_run_is_compared_in_its_shape(
    days: list[Path], tmp_path: Path, first: int, agree: bool
) -> None:
    sources = [days[0], relative_table(days[1], tmp_path / "relative.csv", matt=not agree)]
    done = gonio("compare", *(sources[first:] + sources[:first]), "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["agree_in_shape"] is agree
    assert not found["levels_compared"]
    assert [found[name] for name in ("agree", "chi2", "dof")] == [None, None, None]
    assert [run["level"] for run in found["runs"]] == [None, None]
    brdf = np.array(found["geometries"]["brdf"])
    np.testing.assert_allclose(brdf[0], brdf[1], rtol=0.5)  # on one level
    settings = len(set(found["geometries"]["theta_i_deg"]))
    assert found["dof_shape"] == brdf.shape[1] - settings


def test_relative_runs_alone_have_no_unit(days: list[Path], tmp_path: Path) -> None:
    tables = [relative_table(day, tmp_path / f"{day.parent.name}.csv") for day in days]
    page = tmp_path / "days.html"
    done = gonio("compare", *tables, "--out", page)
    assert done.returncode == 0, done.stderr
    said = " ".join(done.stdout.split())
    assert "agree in their shape; their levels were not compared" in said
    assert "measured without a white tile, so without a level: day1.csv, day2.csv" in said
    html = page.read_text()
    assert "levels were not compared" in html
    assert "1/sr" not in html
    assert "Levels</h2>" not in html


def test_levels_alone_are_nothing_to_compare(days: list[Path], tmp_path: Path) -> None:
    """One view at each incidence is common."""
    relative = relative_table(days[0], tmp_path / "relative.csv")
    with relative.open(newline="") as file:
        places = {row["theta_i_deg"]: row["theta_r_deg"] for row in csv.DictReader(file)}
    lines = [
        f"{theta_i},{float(theta_r) - step},0,0.2,0.01"
        for theta_i, theta_r in places.items()
        for step in (0, 1.3, 2.6)
    ]
    head = "theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf"
    (tmp_path / "few.csv").write_text("\n".join([head, *lines, ""]))
    page = tmp_path / "page.html"
    done = gonio("compare", tmp_path / "few.csv", relative, "--out", page)
    assert done.returncode == 2
    assert "tell the levels of relative.csv and nothing else" in " ".join(done.stderr.split())
    assert not page.exists()


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("theta_i_deg,theta_r_deg,dphi_deg,brdf\n30,0,0,.2\n30,20,0,.2\n", "states no uncertainty"),
        (
            "theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf\n31,1,0,.2,.01\n31,21,0,.2,.01\n",
            "no geometry is common",
        ),
    ],
)
def test_sources_that_cannot_be_compared_are_refused(
    days: list[Path], tmp_path: Path, table: str, words: str
) -> None:
    (tmp_path / "table.csv").write_text(table)
    done = gonio("compare", days[0], tmp_path / "table.csv", "--out", tmp_path / "page.html")
    assert done.returncode == 2
    assert words in " ".join(done.stderr.split())
    assert not (tmp_path / "page.html").exists()


def test_one_run_or_one_named_twice_is_refused(days: list[Path]) -> None:
    for sources in (days[:1], [days[0], days[0]]):
        done = gonio("compare", *sources)
        assert done.returncode == 2
        assert "gonio compare" in done.stderr
