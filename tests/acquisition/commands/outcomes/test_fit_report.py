"""`gonio fit --out`: the report of a run, made from any source, into a new folder."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from tests.support.analysis.no_charts import leave_charts_out
from tests.support.analysis.report_data import words
from tests.support.command import gonio_here as gonio

pytestmark = pytest.mark.charts

HEAD = "theta_i_deg,theta_r_deg,dphi_deg,brdf"


def lambertian(folder: Path, *, scale: float = 1.0, u: bool = True, points: int = 15) -> Path:
    """Table of a matte sample at two incidences, with noise of 1 %."""
    random = np.random.default_rng(7)
    lines = [HEAD + (",u_brdf" if u else "")]
    for theta_i in (20, 50):
        for theta_r in np.linspace(-70, 70, points):
            value = scale * 0.8 / math.pi
            row = f"{theta_i},{theta_r:g},0,{value * random.normal(1, 0.01):.7g}"
            lines.append(row + (f",{0.01 * value:.5g}" if u else ""))
    path = folder / "table.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def page_of(folder: Path) -> str:
    return words((folder / "report.html").read_text())


def test_a_table_gets_the_report_of_a_run(tmp_path: Path) -> None:
    table, folder = lambertian(tmp_path), tmp_path / "fit"
    done = gonio("fit", table, "--models", "lambert,minnaert", "--out", folder)
    assert done.returncode == 0, done.stderr
    names = ["fit.json", "measurements.csv", "report.html"]
    assert sorted(file.name for file in folder.iterdir()) == names
    assert str(folder / "report.html") in done.stderr.replace("\n", "")
    found = json.loads((folder / "fit.json").read_text())
    assert found["chosen"] == "lambert"
    page = page_of(folder)
    assert "lambert: the simplest model that explains the data" in page
    assert "BRDF at each incidence" in page
    assert "table.csv" in page
    assert "SHA-256" in page
    for absent in ("Camera pictures", "Uncertainty budget", "Devices"):
        assert absent not in page


def test_what_is_printed_is_in_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    leave_charts_out(monkeypatch)
    table, folder = lambertian(tmp_path), tmp_path / "fit"
    done = gonio("fit", table, "--models", "lambert", "--out", folder, "--json")
    assert json.loads(done.stdout) == json.loads((folder / "fit.json").read_text())
    for note in json.loads(done.stdout)["notes"]:
        assert note["text"] in page_of(folder)


@pytest.mark.parametrize("options", [(), ("--u-shared", "1%"), ("--relative",)])
@pytest.mark.parametrize("u", [True, False])
def test_its_table_gives_the_same_fit(
    tmp_path: Path, u: bool, options: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Values with an error that all share, too; relative ones keep their form, not their level."""
    leave_charts_out(monkeypatch)
    table, folder = lambertian(tmp_path, u=u), tmp_path / "fit"
    models = ("--models", "lambert,minnaert", "--json")
    first = gonio("fit", table, *models, *options, "--out", folder)
    again = gonio("fit", folder / "measurements.csv", *models)
    assert again.returncode == first.returncode, again.stderr
    ours, theirs = (json.loads(done.stdout) for done in (first, again))
    assert (ours["chosen"], ours["verdict"]) == (theirs["chosen"], theirs["verdict"])
    if not options or "--u-shared" in options:
        for one, other in zip(ours["candidates"], theirs["candidates"], strict=True):
            for name, found in one["parameters"].items():
                assert other["parameters"][name]["value"] == pytest.approx(found["value"], rel=1e-6)
                assert other["parameters"][name]["u"] == pytest.approx(found["u"], rel=1e-4)


@pytest.mark.parametrize("u", [True, False])
def test_relative_values_have_no_unit(tmp_path: Path, u: bool) -> None:
    """Lines of the models are scaled to the points, as nothing else fixes their level."""
    table, folder = lambertian(tmp_path, scale=500.0, u=u), tmp_path / "fit"
    done = gonio("fit", table, "--models", "lambert", "--relative", "--out", folder)
    assert done.returncode == 5
    page = page_of(folder)
    assert "relative BRDF" in page
    assert "1/sr" not in page
    assert "counts/s" not in page
    assert "each scaled to its points" in page


def test_a_fit_that_fails_leaves_the_report(tmp_path: Path) -> None:
    table, folder = lambertian(tmp_path, points=1), tmp_path / "fit"
    done = gonio("fit", table, "--models", "wolff+torrance_sparrow", "--out", folder)
    assert done.returncode == 5
    assert "No model was fitted: 2 points are too few" in page_of(folder)
    assert json.loads((folder / "fit.json").read_text())["chosen"] is None


def test_nothing_is_replaced_and_nothing_left_of_a_wrong_call(tmp_path: Path) -> None:
    table, folder = lambertian(tmp_path), tmp_path / "fit"
    folder.mkdir()
    (folder / "report.html").write_text("mine")
    done = gonio("fit", table, "--models", "lambert", "--out", folder)
    assert done.returncode == 2
    assert "is not empty" in done.stderr
    assert (folder / "report.html").read_text() == "mine"
    for wrong in (("--models", "lambret"), ("--method", "best"), ("--u-shared", "70%")):
        assert gonio("fit", table, *wrong, "--out", tmp_path / "new").returncode == 2
        assert not (tmp_path / "new").exists()
