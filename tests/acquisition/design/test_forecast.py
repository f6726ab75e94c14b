"""Forecast of u: what the fit of the scan then states."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.design.assumed_sample import assumed_sample
from acquisition.design.forecast import asked_parameters, forecast
from acquisition.plan.plan import make_plan
from acquisition.results.fitting import measurements
from acquisition.results.reduction import reduce
from analysis.data.acceptance import Acceptance
from analysis.fit.fit import fit
from instrument.config.camera import DarkPatch
from instrument.config.load import Loaded
from instrument.config.protocol import References
from instrument.errors import InputError
from instrument.record.record import Record
from tests.support.scans import changed, exact_rig
from tests.support.whole_scans.stopped_scan import scan

GLOSSY = "oren_nayar+torrance_sparrow:albedo=0.8,sigma_deg=20,ks=0.076"


def _u(loaded: Loaded, like: str = GLOSSY) -> dict[str, float]:
    return forecast(loaded, make_plan(loaded), assumed_sample(like, loaded)).u()


def test_u_is_that_which_the_fit_of_a_scan_of_an_even_sample_states(
    small: Loaded, record: Record
) -> None:
    given = small.protocol.simulated_sample
    assert given is not None
    even = changed(small, simulated_sample=given.model_copy(update={"mottling": 0.0}))
    scan(even, record)
    reduced = reduce(record.readings(), even.protocol, ())
    acceptance = Acceptance.of(even.rig, even.protocol.window)
    fitted = fit(assumed_sample(None, even).model, measurements(reduced, even), acceptance)
    stated = [u or 0.0 for u in fitted.u.values()]
    assert stated == pytest.approx(list(_u(even).values()), rel=0.1)


def test_the_texture_of_the_sample_adds_to_u(small: Loaded) -> None:
    given = small.protocol.simulated_sample
    assert given is not None
    u = [
        _u(changed(small, simulated_sample=given.model_copy(update={"mottling": mottling})))
        for mottling in (0.0, 0.02, 0.1)
    ]
    assert u[0]["sigma_deg"] < u[1]["sigma_deg"] < u[2]["sigma_deg"]
    assert _u(changed(small, simulated_sample=None)) == pytest.approx(u[1])  # the usual texture


def test_eight_times_the_frames_average_the_part_that_is_said(small: Loaded) -> None:
    """Where angles are exact; else their second-order part may be bounded by the noise."""
    placed = {"u_placement_mm": small.rig.u_placement_mm}
    exact = replace(small, rig=exact_rig(small.rig).model_copy(update=placed))
    plan, sample = make_plan(exact), assumed_sample(GLOSSY, exact)
    longer = tuple(replace(step, frames=8 * step.frames) for step in plan.steps)
    once, often = (forecast(exact, one, sample) for one in (plan, replace(plan, steps=longer)))
    left = np.square(often.problem.covariance.u_independent / once.problem.covariance.u_independent)
    assert once.averaged == pytest.approx((1 - left) * 8 / 7, abs=1e-4)
    assert once.averaged.min() < 0.95 < once.averaged.max()


def test_a_better_tile_lowers_the_u_of_the_albedo(small: Loaded) -> None:
    references = small.protocol.references
    assert references.white_tile is not None
    tile = references.white_tile.model_copy(update={"u_reflectance": 0.0005})
    better = changed(small, references=references.model_copy(update={"white_tile": tile}))
    assert _u(better)["albedo"] < 0.5 * _u(small)["albedo"]
    lambert = "lambert:albedo=0.5"
    assert _u(small, lambert)["albedo"] == pytest.approx(0.5 * 0.005 / 0.99, rel=0.1)


def test_more_frames_hardly_help_where_shared_errors_rule(small: Loaded) -> None:
    many = changed(small, frames_per_point=400)
    lambert = "lambert:albedo=0.5"
    once, often = (_u(loaded, lambert)["albedo"] for loaded in (small, many))
    assert 0.98 < often / once <= 1


@pytest.mark.parametrize("axis", ["theta_i", "theta_r"])
def test_u_follows_the_errors_of_the_angles(small: Loaded, axis: str) -> None:
    axes = small.rig.axes
    own = axes[axis]  # type: ignore[index]  # one of the literals
    worse = axes.model_copy(update={axis: own.model_copy(update={"u_deg": 20 * own.u_deg})})
    u, worse_u = _u(small), _u(changed(small, rig={"axes": worse}))
    assert worse_u["sigma_deg"] > 1.1 * u["sigma_deg"]


def test_the_parameters_asked_for(small: Loaded) -> None:
    sample = assumed_sample(GLOSSY, small)
    assert asked_parameters(None, sample, small) == ["albedo", "sigma_deg", "ks"]
    assert asked_parameters("ks, sigma_deg,ks", sample, small) == ["ks", "sigma_deg"]
    bare = changed(small, references=References())
    assert asked_parameters(None, sample, bare) == ["sigma_deg"]
    relative = forecast(bare, make_plan(bare), sample).u()
    assert set(relative) == {"sigma_deg"}
    assert relative["sigma_deg"] > _u(small)["sigma_deg"]


@pytest.mark.parametrize(
    ("wanted", "references", "words"),
    [
        ("albedo", False, "--for albedo: not determined without a white tile; allowed: sigma_deg"),
        ("n", True, "has no parameter n; allowed: albedo, sigma_deg, ks"),
        ("", True, "has no parameter nothing"),
    ],
)
def test_parameters_that_cannot_be_asked_for(
    small: Loaded, wanted: str, references: bool, words: str
) -> None:
    loaded = small if references else changed(small, references=References())
    with pytest.raises(InputError, match=words):
        asked_parameters(wanted, assumed_sample(GLOSSY, loaded), loaded)


def test_a_sample_that_no_geometry_shows_is_refused(small: Loaded) -> None:
    with pytest.raises(InputError, match="none of its geometries can be used"):
        _u(small, "lambert:albedo=0")


def test_the_sample_of_a_run_is_the_one_that_its_fit_has_chosen(
    small: Loaded, tmp_path: Path
) -> None:
    parameters = '{"albedo": {"value": 0.5, "u": 0.1}, "per_brdf": {"value": 3, "u": 1}}'
    candidate = f'{{"model": "lambert", "parameters": {parameters}}}'
    text = f'{{"chosen": "lambert", "candidates": [{candidate}]}}'
    (tmp_path / "fit.json").write_text(text)
    for like in (tmp_path, tmp_path / "fit.json"):
        sample = assumed_sample(str(like), small)
        assert (sample.model.name, sample.x.tolist()) == ("lambert", [0.5])


@pytest.mark.parametrize(
    ("like", "words"),
    [
        ("lambert", "albedo, which is missing"),
        ("lambert:albedo=2", "albedo = 2; allowed: 0 to 1"),
        ("lambert:albedo", "albedo; allowed: NAME=NUMBER"),
        ("lambert:albedo=x", "albedo=x; allowed: NAME=NUMBER"),
        ("plaster:albedo=1", "unknown model 'plaster'"),
        ("nothing.json", "cannot be read"),
    ],
)
def test_a_text_that_describes_no_sample_is_refused(small: Loaded, like: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        assumed_sample(like, small)


@pytest.mark.parametrize(
    "text", ["", "[]", '{"chosen": null, "candidates": []}', '{"chosen": "lambert"}', "\x00"]
)
def test_a_file_without_a_chosen_model_is_refused(small: Loaded, tmp_path: Path, text: str) -> None:
    (tmp_path / "fit.json").write_text(text)
    with pytest.raises(InputError, match="holds no chosen model"):
        assumed_sample(str(tmp_path), small)


def test_a_protocol_without_a_simulated_sample_needs_one(small: Loaded) -> None:
    with pytest.raises(InputError, match="no simulated_sample to plan for; allowed: --like"):
        assumed_sample(None, changed(small, simulated_sample=None))


def test_a_dark_patch_of_the_rig_does_not_hinder_a_forecast(small: Loaded) -> None:
    patch = DarkPatch(
        x_mm=30.0, y_mm=0.0, width_mm=4.0, height_mm=4.0, reflectance=0.01, u_reflectance=0.01
    )
    camera = small.rig.camera.model_copy(update={"dark_patch": patch})
    with_patch = replace(small, rig=small.rig.model_copy(update={"camera": camera}))
    found = forecast(with_patch, make_plan(with_patch), assumed_sample(None, with_patch))
    assert found.used.all()
