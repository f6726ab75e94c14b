"""Command `gonio plan --optimal`: what it prints and writes, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.command import gonio_here
from tests.support.scans import TWO_MODELS, small_demo


@pytest.fixture(scope="module")
def protocol(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_demo(tmp_path_factory.mktemp("optimal"), f"{TWO_MODELS}, lambert+torrance_sparrow")


@pytest.fixture(scope="module")
def found(protocol: Path) -> dict[str, Any]:
    out = protocol.with_name("few.yaml")
    options = ("--for", "sigma_deg", "--out", out, "--json")
    done = gonio_here("plan", protocol, "--optimal", 8, *options)
    assert done.returncode == 0, done.stderr
    assert f"written: {out}" in done.stderr
    return dict(json.loads(done.stdout))


def test_it_chooses_so_many_and_says_what_each_is_for(found: dict[str, Any]) -> None:
    assert found["for"] == ["sigma_deg"]
    reasons = [geometry["for"] for geometry in found["geometries"]]
    assert len(reasons) == found["optimal"]["points"] == 8
    assert reasons.count("lack of fit") >= 8 / 5
    assert set(reasons) <= {"sigma_deg", "lack of fit", "other models"}


def test_it_gives_a_smaller_u_than_even_sweeps_of_the_same_time(found: dict[str, Any]) -> None:
    even = found["even_sweeps_same_time"]
    assert even["duration_s"] <= 1.05 * found["optimal"]["duration_s"]
    assert found["optimal"]["u"]["sigma_deg"] < even["u"]["sigma_deg"]
    assert found["sweeps"]["points"] == 17  # of 18; in one the lamp hides the camera's view
    assert 0 < found["least_part_of_u"] <= 1


def test_gonio_run_accepts_what_it_writes(found: dict[str, Any], protocol: Path) -> None:
    done = gonio_here("plan", protocol.with_name("few.yaml"), "--json")
    assert done.returncode == 0, done.stderr
    planned = json.loads(done.stdout)
    assert planned["points"] == 8
    assert planned["duration_s"] == pytest.approx(found["optimal"]["duration_s"])


def test_the_tables_and_notes_in_the_terminal(protocol: Path, tmp_path: Path) -> None:
    chart = tmp_path / "u.svg"
    like = "lambert:albedo=0.5"
    done = gonio_here("plan", protocol, "--optimal", 4, "--like", like, "--chart", chart)
    assert done.returncode == 0, done.stderr
    for words in (
        "demo: 4 of ",
        "sample: lambert with albedo 0.5 (--like)",
        "lack of fit",
        "minutes",
        "albedo",
    ):
        assert words in done.stdout
    picture = chart.read_text()
    for words in ("chosen geometries", "even sweeps", "bench time (minutes)", "this plan: 4"):
        assert words in picture


def test_until_a_u_is_reached_with_the_fewest_geometries(protocol: Path, tmp_path: Path) -> None:
    goal, out = {"sigma_deg": 0.03, "albedo": 0.004}, tmp_path / "few.yaml"
    text = ",".join(f"{name}={u}" for name, u in goal.items())
    done = gonio_here("plan", protocol, "--until", text, "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["until"] == goal
    assert f"--until {text}" in out.read_text().replace("\n# ", " ")
    assert all(found["optimal"]["u"][name] <= u for name, u in goal.items())
    for name in goal:
        assert sum(found["parts_of_variance"][name].values()) == pytest.approx(1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--out", "x.yaml"], "gonio plan: --out: allowed with --optimal N or --until only"),
        (
            ["--for", "ks", "--chart", "x.png"],
            "--for, --chart: allowed with --optimal N or --until",
        ),
        (["--optimal", 8, "--for", "n"], "has no parameter n; allowed: albedo, sigma_deg, ks"),
        (["--optimal", 2], "--optimal 2; allowed: 3, the parameters to determine, to 30"),
        (["--optimal", 31], "--optimal 31; allowed: 3"),
        (["--optimal", 8, "--out", "x.txt"], "allowed: a name with .yaml"),
        (["--optimal", 8, "--chart", "x.gif"], "x.gif: --chart must end in .png, .svg, .pdf"),
        (["--optimal", 8, "--out", "no/x.yaml"], "there is no folder no; make it first"),
        (["--optimal", 8, "--out", "taken.yaml"], "taken.yaml: exists already"),
        (["--until", "sigma_deg=1", "--optimal", 8], "--optimal: not allowed with --until"),
        (["--until", "sigma_deg=1", "--for", "ks"], "--for: not allowed with --until"),
        (["--until", "sigma_deg=1e-9"], "--until sigma_deg=1e-09: all 30 candidates together"),
        (["--optimal", 8, "--like", "lambert"], "--like lambert: lambert needs albedo"),
    ],
)
def test_a_mistake_ends_with_2_and_writes_nothing(
    protocol: Path, tmp_path: Path, options: list[object], words: str
) -> None:
    (tmp_path / "taken.yaml").write_text("mine")
    done = gonio_here("plan", protocol, *options, cwd=tmp_path)
    assert done.returncode == 2
    assert words in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["taken.yaml"]
    assert (tmp_path / "taken.yaml").read_text() == "mine"


def test_a_scan_that_does_not_stop_has_no_chosen_geometries(protocol: Path, tmp_path: Path) -> None:
    flown, out = protocol.with_name("flown.yaml"), tmp_path / "few.yaml"
    flown.write_text(protocol.read_text() + "motion: fly\n")
    for option in (("--optimal", 8), ("--until", "sigma_deg=0.5")):
        done = gonio_here("plan", flown, *option, "--out", out)
        assert done.returncode == 2
        assert "flown.yaml: motion: fly" in done.stderr
        assert not out.exists()
