"""A fit from Python: recovered parameters, words, and errors that say what is allowed."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.notebook.fits import fit
from acquisition.notebook.runs import Run
from analysis.data.measurements import Measurements
from analysis.models import MODELS
from instrument.errors import InputError, NotDetermined
from instrument.geometry import Geometry

ALBEDO, NOISE = 0.6, 0.005


def _lambertian(seed: int, relative: bool = False) -> Measurements:
    rng = np.random.default_rng(seed)
    theta_i, theta_r = rng.uniform(0, 70, 40), rng.uniform(-70, 70, 40)
    brdf = ALBEDO / np.pi * (1 + NOISE * rng.standard_normal(40))
    m = Measurements.bare(theta_i, theta_r, 0.0, brdf, NOISE * brdf)
    return m if not relative else Measurements(
        theta_i_deg=m.theta_i_deg, theta_r_deg=m.theta_r_deg, dphi_deg=m.dphi_deg, brdf=m.brdf,
        u_random=m.u_random, lamp_setting=m.lamp_setting, relative=True,
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
def test_arrays_are_fitted_and_the_truth_lies_within_u(seed: int) -> None:
    found = fit(_lambertian(seed), ["lambert"])
    albedo, u = found.parameters["albedo"]
    assert u is not None
    assert abs(albedo - ALBEDO) < 4.5 * u
    assert found.best is not None
    normal = Geometry.from_degrees(theta_i=0, theta_r=0)
    assert found.best.brdf(normal) == pytest.approx(albedo / np.pi)


def test_a_run_is_fitted_as_by_its_own_method(scanned: Run) -> None:
    assert fit(scanned, ["lambert"]).to_json() == scanned.fit(["lambert"]).to_json()


def test_one_line_and_a_table_name_model_verdict_and_values() -> None:
    found = fit(_lambertian(1), ["lambert", "oren_nayar"])
    assert found.best is not None
    line, html = repr(found), found._repr_html_()
    assert line.startswith("<fit of 40 points: ")
    assert "\n" not in line
    for words in (found.best.model, "albedo"):
        assert words in line
        assert words in html
    assert html.count("<table>") == html.count("</table>") == 2
    assert {c.model for c in found.candidates} == {"lambert", "oren_nayar"}


def test_the_legend_names_each_model_that_is_drawn() -> None:
    found = fit(_lambertian(1), ["lambert", "oren_nayar"])
    assert found.best is not None
    legend = found.plot().axes[0].get_legend()
    assert legend is not None
    names = [text.get_text() for text in legend.get_texts()]
    assert names[0] == found.best.model
    assert set(names) == {"lambert", "oren_nayar"}


def test_relative_values_are_drawn_in_their_own_unit() -> None:
    ax = fit(_lambertian(2, relative=True), ["lambert"]).plot().axes[0]
    assert "radiance" in ax.get_ylabel()
    ax = fit(_lambertian(2), ["lambert"]).plot().axes[0]
    assert ax.get_ylabel() == "BRDF (1/sr)"


@pytest.mark.parametrize("models", [["lambret"], "lambert+lambert", ["lambert", "phong"]])
def test_an_unknown_model_is_refused_with_the_known_ones(models: list[str]) -> None:
    with pytest.raises(InputError, match=r"models: .*(known: lambert|each model once)"):
        fit(_lambertian(0), models)


def test_an_unknown_method_is_refused_with_those_allowed() -> None:
    with pytest.raises(InputError, match="method: 'fast'; allowed: auto, "):
        fit(_lambertian(0), method="fast")


def test_too_few_points_are_an_error_of_the_data() -> None:
    one = Measurements.bare(30.0, [10.0], 0.0, [0.2])
    with pytest.raises(NotDetermined):
        fit(one, ["oren_nayar+torrance_sparrow"])


def test_a_single_name_is_one_candidate() -> None:
    (only,) = fit(_lambertian(0), "lambert").candidates
    assert only.model == "lambert"
    assert only.model in MODELS
