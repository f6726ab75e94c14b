"""`gonio fit`: what it reads, what it prints, and how it ends."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from acquisition.terminal.console import EscapingConsole
from analysis.models import MODELS
from instrument.geometry import Geometry
from tests.support.command import gonio_here as gonio
from tests.support.paths import ROOT
from tests.support.scans import small_demo

CURET = ROOT.parent / "shared" / "data" / "curet"
TWO = "lambert,oren_nayar"
VIEWS = np.arange(-70.0, 71.0, 10.0)
HEADER = "theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf\n"


def table(path: Path, name: str, incidences: tuple[float, ...], **truth: float) -> Path:
    """A CSV of one model with noise of half a per cent."""
    theta_i, theta_r = (a.ravel() for a in np.meshgrid(incidences, VIEWS, indexing="ij"))
    f = MODELS[name].brdf(Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r), **truth)
    f = f * (1 + 0.005 * np.random.default_rng(4).standard_normal(f.size))
    rows = zip(theta_i, theta_r, f, strict=True)
    path.write_text(HEADER + "".join(f"{i},{r},0,{v},{0.005 * v}\n" for i, r, v in rows))
    return path


@pytest.fixture(scope="module")
def rough(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("csv") / "rough.csv"
    return table(path, "oren_nayar", (30.0, 45.0, 60.0), albedo=0.8, sigma_deg=30.0)


def test_json_alone_is_on_standard_output(rough: Path) -> None:
    done = gonio("fit", rough, "--json")
    assert done.returncode == 0, done.stderr
    fit = json.loads(done.stdout)
    assert (fit["chosen"], fit["verdict"]) == ("oren_nayar", "adequate")
    assert fit["symmetry"]["says"] == "rough"
    sigma = next(c for c in fit["candidates"] if c["model"] == "oren_nayar")["parameters"][
        "sigma_deg"
    ]
    assert abs(sigma["value"] - 30) < 4 * sigma["u"]


def test_reading_a_long_table_and_fitting_it_are_told_apart_while_one_waits(
    rough: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A table of 1.7 million rows takes a minute to read; `test_progress` tests what is shown."""
    tasks: list[str] = []

    def noted(task: str) -> contextlib.AbstractContextManager[None]:
        tasks.append(task)
        return contextlib.nullcontext()

    monkeypatch.setattr("acquisition.commands.fit.sign_of_life", noted)
    assert gonio("fit", rough, "--models", "lambert").returncode == 0
    assert tasks == ["reading rough.csv", f"fit of {3 * VIEWS.size} points"]


def test_a_person_reads_parameters_candidates_and_why(rough: Path) -> None:
    done = gonio("fit", rough, "--models", "lambert,oren_nayar")
    assert done.returncode == 0, done.stderr
    for words in ("oren_nayar: the simplest model", "sigma_deg", "±", "ΔBIC", "ΔAICc", "symmetry"):
        assert words in done.stdout
    assert "wolff" not in done.stdout


def test_a_narrow_terminal_cuts_no_number(rough: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def printed(columns: int) -> str:
        monkeypatch.setattr(EscapingConsole, "width", columns)
        models = "lambert,lambert+torrance_sparrow,oren_nayar"
        return gonio("fit", rough, "--models", models).stdout

    number = r"-?\d[\d.e+]*"
    wide, narrow = printed(200), printed(50)
    assert sorted(re.findall(number, narrow)) == sorted(re.findall(number, wide))
    assert max(map(len, narrow.splitlines())) <= 50 < max(map(len, wide.splitlines()))


def test_the_rough_surface_is_worked_out_as_asked(rough: Path) -> None:
    done = gonio("fit", rough, "--method", "qualitative", "--json")
    names = {c["model"] for c in json.loads(done.stdout)["candidates"]}
    assert "oren_nayar_qualitative" in names
    assert not names & {"oren_nayar", "oren_nayar_exact"}


def test_where_the_model_does_not_hold_is_told(tmp_path: Path) -> None:
    truth = {"albedo": 0.3, "sigma_deg": 20.0}
    oblique = table(tmp_path / "oblique.csv", "oren_nayar", (45.0, 86.0), **truth)
    done = gonio("fit", oblique, "--models", "oren_nayar")
    assert re.search(r"\d+ of \d+ points are outside the model's range of validity", done.stdout)


def test_none_adequate_is_a_result(rough: Path) -> None:
    done = gonio("fit", rough, "--models", "lambert", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["verdict"] == "none adequate"


def test_what_the_data_do_not_determine_ends_with_5_and_its_json(tmp_path: Path) -> None:
    normal = table(tmp_path / "normal.csv", "oren_nayar", (0.0,), albedo=0.8, sigma_deg=30.0)
    done = gonio("fit", normal, "--models", "oren_nayar", "--json")
    assert done.returncode == 5
    fit = json.loads(done.stdout)
    assert fit["verdict"] == "not identifiable"
    parameters = fit["candidates"][0]["parameters"]
    assert parameters["sigma_deg"]["u"] is None
    low, high = parameters["sigma_deg"]["interval"]
    assert low <= 30 <= high
    assert "the data do not determine" in done.stderr


def test_too_few_points_for_any_fit_end_with_5_and_their_json(tmp_path: Path) -> None:
    path = tmp_path / "one.csv"
    path.write_text(HEADER + "30,0,0,0.2,0.001\n")
    done = gonio("fit", path, "--models", "oren_nayar", "--json")
    assert done.returncode == 5
    assert json.loads(done.stdout)["chosen"] is None
    assert "1 point is too few" in done.stderr


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEADER + "30,0,0,zero,0.001\n", ":2:8: brdf: 'zero' is text"),
        (HEADER + "30,0,0,0.2,-1\n", ":2:12: u_brdf: -1 1/sr; allowed: 1e-15 to 1e15 1/sr"),
        (HEADER + "95,0,0,0.2,0.1\n", ":2:1: theta_i_deg: 95 deg; allowed: a number from 0 to 90"),
        (HEADER + "30,0,0,nan,0.1\n", ":2:8: brdf: 'nan' is not finite"),
        (HEADER + 2 * "30,0,0,0.2,0.1\n", ":3:1: theta_i_deg: the same three angles"),
        ("theta_i_deg,theta_r_deg,brdf\n30,0,0.2\n", ":1:1: header: missing: dphi_deg; found"),
        ("", ":1:1: the file is empty"),
    ],
)
def test_mistakes_in_a_table_end_with_2_and_their_place(
    text: str, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text(text)
    done = gonio("fit", path, "--json")
    assert done.returncode == 2
    assert f"{path}{words}" in done.stderr
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--models", "phong,lambert"), "--models: unknown model 'phong'"),
        (("--models", "lambert,lambert"), "named twice"),
        (("--max-theta-deg", "0"), "--max-theta-deg: 0 degrees; allowed: above 0, up to 90"),
        (("--max-theta-deg", "nan"), "--max-theta-deg: nan degrees"),
        (("--format", "xml"), "--format: xml; allowed: auto, run, csv, curet"),
        (("--sample", "3"), "--sample: 3 for the format csv"),
        (("--method", "cubic"), "--method: cubic; allowed: auto, qualitative, functional, exact"),
        (("--method", "exact", "--models", "lambert"), "--method: exact; allowed: auto, as"),
    ],
)
def test_wrong_options_are_named(rough: Path, options: tuple[str, ...], words: str) -> None:
    done = gonio("fit", rough, *options)
    assert done.returncode == 2
    assert words in done.stderr


def test_angles_can_be_cut(rough: Path) -> None:
    done = gonio("fit", rough, "--max-theta-deg", "45")
    assert done.returncode == 0, done.stderr
    assert "points lie beyond 45 degrees" in done.stdout


def test_outliers_are_named_on_request(rough: Path, tmp_path: Path) -> None:
    lines = rough.read_text().splitlines()
    fields = lines[8].split(",")
    lines[8] = ",".join([*fields[:3], str(1.5 * float(fields[3])), fields[4]])
    path = tmp_path / "outlier.csv"
    path.write_text("\n".join(lines))
    candidates = ("--models", "lambert,oren_nayar_qualitative,oren_nayar")
    assert "none explains" in gonio("fit", path, *candidates).stdout
    done = gonio("fit", path, *candidates, "--robust")
    assert done.returncode == 0, done.stderr
    assert "oren_nayar: the simplest model" in done.stdout
    assert "1 outliers set aside" in done.stdout
    assert f"set aside: theta_i 30, theta_r {float(fields[1]):g}" in done.stdout


def test_relative_values_give_the_roughness_and_no_albedo(rough: Path, tmp_path: Path) -> None:
    rows = [line.split(",") for line in rough.read_text().splitlines()[1:]]
    scaled = [f"{i},{r},{p},{37 * float(f)},{37 * float(u)}\n" for i, r, p, f, u in rows]
    path = tmp_path / "relative.csv"
    path.write_text(HEADER + "".join(scaled))
    candidates = ("--models", "lambert,oren_nayar_qualitative,oren_nayar")
    done = gonio("fit", path, *candidates, "--relative", "--json")
    assert done.returncode == 5
    fit = json.loads(done.stdout)
    found = next(c for c in fit["candidates"] if c["model"] == fit["chosen"])["parameters"]
    assert abs(found["sigma_deg"]["value"] - 30) < 4 * found["sigma_deg"]["u"]
    assert found["albedo"]["u"] is None
    assert found["per_brdf"]["u"] is None


def dull_demo(folder: Path, model: str, fit: str) -> Path:
    """The small demonstration without lobe: an early candidate explains it, so few are tried."""
    protocol = small_demo(folder)
    text = protocol.read_text().replace("oren_nayar+torrance_sparrow", model)
    protocol.write_text(f"{text.replace(', ks: 0.076', '')}{fit}\n")
    return protocol


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tile", "model", "block", "options"),
    [
        (True, "oren_nayar", "", ()),
        (True, "oren_nayar_qualitative", "fit: {method: qualitative}", ("--method", "qualitative")),
        (True, "oren_nayar", "fit: {models: [lambert, oren_nayar]}", ("--models", TWO)),
        (False, "oren_nayar", "fit: {models: [lambert, oren_nayar]}", ("--models", TWO)),
    ],
)
def test_a_run_and_its_table_are_fitted_as_at_the_run_s_end(
    tile: bool, model: str, block: str, options: tuple[str, ...], slow: bool, tmp_path: Path
) -> None:
    """Fits of the folder follow the protocol's `fit:`; a table has the numbers alone."""
    if not (slow or block):
        pytest.skip("with --slow: the next case makes a choice of its own too")
    protocol = dull_demo(tmp_path, model, block)
    if not tile:
        protocol.write_text(re.sub(r"  white_tile:.*\n", "", protocol.read_text()))
    done = gonio("run", protocol, "--out", tmp_path / "run", "--json")
    at_end = json.loads(done.stdout)
    assert at_end["candidates"]
    again = gonio("fit", tmp_path / "run", "--json")
    assert json.loads(again.stdout) == at_end
    table_alone = gonio("fit", tmp_path / "run" / "measurements.csv", *options, "--json")
    assert json.loads(table_alone.stdout) == at_end


def test_options_go_before_the_fit_block_of_a_run(tmp_path: Path) -> None:
    protocol = dull_demo(tmp_path, "oren_nayar_qualitative", "fit: {models: [lambert]}")
    gonio("run", protocol, "--out", tmp_path / "run", "--json")
    done = gonio("fit", tmp_path / "run", "--models", "wolff", "--json")
    assert json.loads(done.stdout)["chosen"] == "wolff"
    done = gonio("fit", tmp_path / "run", "--method", "qualitative", "--json")
    assert len(json.loads(done.stdout)["candidates"]) > 1
    refused = gonio("fit", tmp_path / "run", "--u-shared", "1%")
    assert refused.returncode == 2
    assert "--u-shared: 0.01 for a run, which states its own shared errors" in refused.stderr


def test_a_run_with_a_polariser_finds_the_index_of_its_sample(tmp_path: Path) -> None:
    """Taken for natural light, the same table gives another index."""
    angle_deg = 90
    truth = {"index": 1.45, "lobe_sigma_deg": 15.0}
    protocol, name = small_demo(tmp_path, "lambert+fresnel_lobe"), f"fresnel_lobe@{angle_deg}"
    text = protocol.read_text().replace("oren_nayar+torrance_sparrow", "lambert+fresnel_lobe")
    text = text.replace("sigma_deg: 20.0, ks: 0.076", "index: 1.45, lobe_sigma_deg: 15.0")
    protocol.write_text(f"{text}polariser_deg: {angle_deg}\n")
    done = gonio("run", protocol, "--out", tmp_path / "run", "--json")
    assert json.loads(done.stdout)["chosen"] == f"lambert+{name}", done.stderr
    done = gonio("fit", tmp_path / "run", "--models", "lambert+fresnel_lobe", "--json")
    (found,) = json.loads(done.stdout)["candidates"]
    assert found["model"] == f"lambert+{name}"
    for key, true in truth.items():
        parameter = found["parameters"][key]
        assert abs(parameter["value"] - true) < 4 * parameter["u"], key
    table_alone = tmp_path / "run" / "measurements.csv"
    done = gonio("fit", table_alone, "--models", "lambert+fresnel_lobe", "--json")
    natural = json.loads(done.stdout)["candidates"][0]["parameters"]["index"]
    assert abs(natural["value"] - truth["index"]) > 2 * natural["u"]


def test_a_polariser_s_angle_is_refused_out_of_plane(tmp_path: Path) -> None:
    path = tmp_path / "across.csv"
    path.write_text(HEADER + "".join(f"40,{r},90,0.2,0.001\n" for r in range(5, 60, 5)))
    done = gonio("fit", path, "--models", "lambert+fresnel_lobe@30")
    assert done.returncode == 2
    assert "lambert+fresnel_lobe@30: 11 of 11 points lie out of plane" in done.stderr
    assert done.stdout == ""


def notes(done: subprocess.CompletedProcess[str]) -> dict[str, str]:
    return {note["code"]: note["text"] for note in json.loads(done.stdout)["notes"]}


def test_what_a_table_does_not_state_is_named_as_assumed(rough: Path) -> None:
    options = ("--models", "lambert,oren_nayar")
    found = notes(gonio("fit", rough, *options, "--json"))
    assert set(found) >= {
        "assumed_no_shared_error", "assumed_exact_angles", "assumed_small_acceptance",
    }  # fmt: skip
    printed = " ".join(gonio("fit", rough, *options).stdout.split())
    assert all(text in printed for text in found.values())
    stated = notes(gonio("fit", rough, *options, "--u-shared", "0.5%", "--json"))
    assert "assumed_no_shared_error" not in stated
    assert stated["u_shared"] == "all values share an error of 0.5 % (--u-shared)"


def test_a_suspicion_about_the_table_is_printed_and_stands_in_the_json(
    rough: Path, tmp_path: Path
) -> None:
    """The lamp on the other side: theta_r with the wrong sign."""
    rows = [line.split(",") for line in rough.read_text().splitlines()]
    turned = [[i, str(-float(r)), *rest] for i, r, *rest in rows[1:]]
    path = tmp_path / "swapped.csv"
    path.write_text(HEADER + "".join(",".join(row) + "\n" for row in turned))
    options = ("--models", "lambert,oren_nayar")
    text = notes(gonio("fit", path, *options, "--json"))["lamp_side"]
    assert "the sign of theta_r" in text
    assert text in " ".join(gonio("fit", path, *options).stdout.split())


@pytest.mark.parametrize("with_u", [True, False], ids=["u_brdf", "no u"])
@pytest.mark.parametrize("u_shared", ["2%", "0.02", " 2 % "])
def test_a_u_that_all_values_share_widens_that_of_the_albedo(
    with_u: bool, u_shared: str, rough: Path, tmp_path: Path
) -> None:
    """A common factor changes Lambert's albedo by itself: variances add."""
    path = tmp_path / "table.csv"
    path.write_text(table(path, "lambert", (30.0, 60.0), albedo=0.8).read_text())
    if not with_u:
        rows = [line.split(",")[:4] for line in path.read_text().splitlines()]
        path.write_text("\n".join(map(",".join, rows)))

    def albedo(*options: str) -> dict[str, float]:
        done = gonio("fit", path, "--models", "lambert", "--json", *options)
        found: dict[str, float] = json.loads(done.stdout)["candidates"][0]["parameters"]["albedo"]
        return found

    alone, both = albedo(), albedo("--u-shared", u_shared)
    assert both["value"] == pytest.approx(alone["value"], rel=1e-4)
    expected = np.hypot(alone["u"], 0.02 * alone["value"])
    assert both["u"] == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("text", ["0", "0%", "50%", "0.5", "-1%", "nan", "much", "", "%", "1e-400"])
def test_a_wrong_u_shared_is_named_with_what_is_allowed(text: str, rough: Path) -> None:
    done = gonio("fit", rough, f"--u-shared={text}")
    assert done.returncode == 2
    assert done.stderr.startswith("--u-shared: ")
    assert "allowed: more than 0 and less than 50 %, as 0.5% or 0.005" in done.stderr


def test_a_folder_that_is_no_run_says_what_to_name(tmp_path: Path) -> None:
    done = gonio("fit", tmp_path)
    assert done.returncode == 2
    assert f"{tmp_path}: a folder without record.sqlite is no run" in done.stderr


@pytest.mark.skipif(not CURET.is_dir(), reason="the CUReT tables are not beside the project")
def test_a_material_of_the_curet_database() -> None:
    options = ("--format", "curet", "--sample", "10", "--max-theta-deg", "68.8")
    done = gonio("fit", CURET, *options, "--models", "lambert,oren_nayar")
    assert done.returncode == 0, done.stderr
    assert "116 of 116 directions up to 68.8 degrees" in done.stdout
    assert "1.88 %" in done.stdout
    assert "no u is stated: the noise is estimated from the residuals" in done.stdout
    assert gonio("fit", CURET).returncode == 2
