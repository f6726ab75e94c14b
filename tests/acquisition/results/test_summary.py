"""Results in words: the headline, parameters, notes and the uncertainty budget."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.engine.engine import Engine
from acquisition.plan.plan import make_plan
from acquisition.results.fitting import Fitted, fit_run, u_without
from acquisition.results.reduction import DARK, NOISE, ROUNDING, TILE, Reduced, reduced_run
from acquisition.results.run_folder import run_meta
from acquisition.results.summary import budget, headline, notes, value_text
from acquisition.rig import open_devices
from analysis.models import MODELS
from analysis.report.data import Parameter
from instrument.config.load import Loaded
from instrument.config.protocol import FitConfig, WhiteTile
from instrument.geometry import Geometry
from instrument.record.event_kinds import INTERLOCK
from instrument.record.reading import Check
from instrument.record.record import Record
from tests.support.scans import TWO_MODELS, changed, exact_rig, small_scan
from tests.support.white_tiles import SPECTRALON, table_text, tabled, with_tile

Results = tuple[Loaded, Reduced, Fitted, tuple[str, ...]]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """A small scan of the rig with an 8-bit camera, whose lamp is set by hand."""
    loaded = changed(small_scan("paper_1995"), fit=FitConfig(models=TWO_MODELS.split(", ")))
    plan, folder = make_plan(loaded), tmp_path_factory.mktemp("summary") / "run"
    with Record.create(folder, run_meta(loaded, plan)) as record:
        engine = Engine(loaded.protocol, loaded.rig, open_devices(loaded), record, [].append)
        engine.run(plan)
        reduced = reduced_run(record, loaded)
        fitted = fit_run(reduced, loaded)
        return loaded, reduced, fitted, notes(reduced, fitted, record, loaded)


def test_the_headline_names_the_model_and_the_verdict(results: Results) -> None:
    _, _, fitted, _ = results
    assert fitted.choice is not None
    assert headline(fitted).startswith(f"{fitted.choice.chosen}: ")
    assert headline(Fitted(None, fitted.used, "2 points are too few")) == (
        "No model was fitted: 2 points are too few."
    )


def test_notes_name_the_simulation_the_tile_and_the_camera_s_rounding(results: Results) -> None:
    found = results[3]
    assert "all data are simulated" in found
    assert any(note.startswith("the white tile is assumed to be Lambertian; ") for note in found)
    assert any(note.startswith("8-bit camera: rounding frames") for note in found)


@pytest.mark.parametrize(
    ("keys", "note"),
    [
        ({"certificate": "lambertian"}, "the white tile is Lambertian by its certificate in the"),
        ({"certificate": "8/hemispherical"}, "certified at 8/hemispherical and used elsewhere: a u"
         " of 4 % is added; a table"),
        ({"certificate": "45/0"}, "certified at 45/0 and used elsewhere: a u of 4 % is added"),
        ({}, "the white tile is assumed to be Lambertian; sintered PTFE is not, by some 4 % at 30"),
    ],
)  # fmt: skip
def test_a_note_says_how_far_the_tile_s_number_holds(
    keys: dict[str, str], note: str, results: Results, record: Record
) -> None:
    loaded, reduced, fitted, _ = results
    tile = WhiteTile(reflectance=0.99, u_reflectance=0.005, theta_r_deg=10.0)
    stated = with_tile(loaded, tile.model_copy(update=keys))
    assert sum(note in text for text in notes(reduced, fitted, record, stated)) == 1


def test_a_note_gives_the_span_of_a_table(results: Results, record: Record, tmp_path: Path) -> None:
    loaded, reduced, fitted, _ = results
    tabled_scan = with_tile(loaded, tabled(table_text(SPECTRALON, 0.003, 0.0), tmp_path))
    text = "radiance factor is 0.959 to 1.029 at the angles of its readings, linear between the"
    found = notes(reduced, fitted, record, tabled_scan)
    assert [n for n in found if "radiance factor" in n and text in n]


def test_the_protocol_lets_the_certificate_lead(results: Results) -> None:
    """The form of exact values would tell the scale of a rough surface; this key forbids it."""
    loaded, reduced, _, _ = results
    angles = {n: [getattr(p, f"{n}_deg") for p in reduced.points] for n in ("theta_i", "theta_r")}
    rough = MODELS["oren_nayar"].brdf(Geometry.from_degrees(**angles), albedo=0.8, sigma_deg=30.0)
    precise = replace(
        reduced,
        brdf=rough,
        components={NOISE: np.full(rough.size, 5e-5)},
        shared=(),
        shared_by_tile=tuple(e for e in reduced.shared_by_tile if e.name == TILE),
    )
    u = {}
    for scale in ("model", "certificate"):
        asked = FitConfig(models=["oren_nayar"], scale=scale)
        exact = replace(changed(loaded, fit=asked), rig=exact_rig(loaded.rig))
        chosen = fit_run(precise, exact).chosen
        assert chosen is not None
        u[scale] = (chosen.u["albedo"] or 0.0) / 0.8
    assert u["model"] < 0.8 * 0.005 / 0.99 < u["certificate"]


def test_less_rounding_never_costs_u(results: Results) -> None:
    _, reduced, fitted, _ = results
    changes = u_without((ROUNDING, DARK), fitted, reduced)
    assert changes
    assert all(without <= u for u, without in changes.values())
    same = u_without((), fitted, reduced)
    assert all(without == u for u, without in same.values())


def test_the_budget_shares_the_whole_variance(results: Results) -> None:
    _, reduced, fitted, _ = results
    parts = fitted.parts(reduced)
    whole = np.sqrt(np.sum([u[fitted.used] ** 2 for u in parts.values()], axis=0))
    u = fitted.u_brdf(reduced)[fitted.used] / reduced.brdf[fitted.used]
    assert whole == pytest.approx(u, rel=0.02)  # but for correlations of the angles of one error
    rows = budget(parts)
    assert sum(share for _, _, share in rows) == pytest.approx(100.0)
    assert [share for _, _, share in rows] == sorted((r[2] for r in rows), reverse=True)
    assert np.all([u >= 0 for _, u, _ in rows])


@pytest.mark.parametrize(
    ("parameter", "text"),
    [
        (Parameter("sigma_deg", 20.013, 0.021, None, "°"), "20.013 ± 0.021\u00a0°"),
        (Parameter("n", 1.5, None, (1.2, 2.0), ""), "not determined, within [1.2, 2]"),
    ],
)
def test_a_parameter_has_its_u_or_its_interval(parameter: Parameter, text: str) -> None:
    assert value_text(parameter) == text


def test_what_the_interlocks_noted_and_jumps_of_the_lamp_are_told(
    results: Results, record: Record
) -> None:
    loaded, reduced, fitted, before = results
    assert not any("interlocks noted" in note for note in before)
    for text in ("dark at 0.1 s: +3 DN", "drift check: jumped", "drift check: jumped"):
        record.add_event("", INTERLOCK, text)
    jumped = Check(before_step=1, expected=1.0, u_expected=0.1, jumped=True,
                   reading=reduced.points[0])  # fmt: skip
    record.add_check(jumped)
    found = notes(reduced, fitted, record, loaded)
    assert "interlocks noted: dark at 0.1 s: +3 DN (1 more, see the events in the record)" in found
    assert any("the lamp level had jumped 1 time and is followed from there" in n for n in found)


def test_a_scatter_far_above_the_noise_is_named_with_its_ratio(
    results: Results, record: Record
) -> None:
    loaded, reduced, fitted, found = results
    assert not any("times as much as" in note for note in found)
    points = tuple(replace(p, u_noise_dn=4 * p.u_noise_dn) for p in reduced.points)
    unsteady = replace(reduced, points=points, drift_scatter=2.5)
    (note,) = (n for n in notes(unsteady, fitted, record, loaded) if "times as much as" in n)
    ratio = float(note.split("scatter ")[1].split(" times")[0])
    assert 2.5 < ratio < 6
    assert "drift checks scatter 2.5 times as much as their noise" in note
