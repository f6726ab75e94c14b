"""Of very many points a part shows the minima, and which models are hopeless: the same choice.

The limits are lowered, so that the whole search is quick enough to compare with; with --slow they
are the program's own.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from analysis.choice.choice import Choice, choose
from analysis.choice.ladder import functional_form
from analysis.data.measurements import Measurements, SharedError
from analysis.fit import first_fit
from analysis.fit.fit import FitResult, fit
from analysis.models import MODELS, Model
from instrument.geometry import Geometry

MATERIALS = ("oren_nayar", "oren_nayar+torrance_sparrow", "lambert+ggx", "minnaert", "wolff")
# chi2 of a model that is hopeless, over its least; and over that of the best model, from which on
# its value does not matter.
MOST_ABOVE, OUT_OF_QUESTION = 1.2, 100.0
DEEPER = 0.999  # chi2 of a deeper minimum, as a fraction of that which the other search found
ROUNDING_OF_BIC = 0.01  # both searches follow a minimum only until a step lowers chi2 by less
# Time of a point among four times as many over that of one among few, which are quicker in the
# processor's cache: 1.1 to 1.4 beside other work, 4 if the time rose as the square of their number.
MOST_A_POINT = 2.2
BOUNDED, BOUNDED_WITH_SHARED = (1, 4), (2,)  # seeds
FACTOR = 8  # of the number of points, from the program's limits to those of the bounded form


def drawn(seed: int, size: int) -> Measurements:
    """Return points of a random material, every other time one that no model explains."""
    draw = np.random.default_rng(seed)
    model = MODELS[MATERIALS[seed % len(MATERIALS)]]
    values = {
        p.name: float(np.exp(draw.uniform(np.log(p.starts[0]), np.log(p.starts[-1]))))
        for p in model.parameters
    }
    theta_i = np.repeat(np.arange(5.0, 75.0, 5.0), size // 14 + 1)[:size]
    theta_r, dphi = draw.uniform(0, 80, size), draw.uniform(0, 180, size)
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    brdf = model.brdf(geometry, **values)
    if seed % 2:
        brdf *= 1 + 0.1 * np.sin(np.radians(5 * theta_r + 3 * dphi))
    u = 0.01 * brdf
    return Measurements.bare(theta_i, theta_r, dphi, brdf + u * draw.standard_normal(size), u)


@dataclass(frozen=True)
class Compared:
    """A choice with the part of the points, one without, and their time in s of processor."""

    quick: Choice
    whole: Choice
    quick_s: float
    whole_s: float


def compared(m: Measurements, very_many: int, part: int, patch: pytest.MonkeyPatch) -> Compared:
    patch.setattr(first_fit, "_VERY_MANY", very_many)
    patch.setattr(first_fit, "_PART", part)
    begun_s = time.process_time()
    quick = choose(m)
    quick_s = time.process_time() - begun_s
    patch.setattr(first_fit, "_VERY_MANY", m.size)
    begun_s = time.process_time()
    return Compared(quick, choose(m), quick_s, time.process_time() - begun_s)


def with_shared_errors(m: Measurements, seed: int) -> Measurements:
    """Give the points of each incidence the errors of one lamp setting and of one tile."""
    draw = np.random.default_rng([seed, 1])
    _, incidence = np.unique(m.theta_i_deg, return_inverse=True)
    size = incidence.max() + 1
    factor = (1 + 0.003 * draw.standard_normal(size)[incidence]) * (1 + 0.01 * draw.normal())
    tiles = SharedError("tile", np.full(m.size, 0.003), incidence)
    certificate = SharedError.common_to_all("certificate", 0.01, m.size)
    return replace(
        m, brdf=m.brdf * factor, lamp_setting=incidence, shared=(tiles, certificate),
        u_theta_i_deg=0.05,
    )  # fmt: skip


Comparison = Callable[[Callable[[int], Measurements]], Compared]


@pytest.fixture
def comparison(
    slow: bool, monkeypatch: pytest.MonkeyPatch, record_property: Callable[[str, object], None]
) -> Comparison:
    """Compare both searches in points that are drawn; their number is that of the form."""
    factor = 1 if slow else FACTOR
    very_many, part = first_fit._VERY_MANY // factor, first_fit._PART // factor

    def compare(draw: Callable[[int], Measurements]) -> Compared:
        found = compared(draw(2 * very_many), very_many, part, monkeypatch)
        record_property("time of the search with all points", found.whole_s / found.quick_s)
        require_same_choice(found.quick, found.whole)
        return found

    return compare


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_the_choice_is_that_of_a_search_with_all_points(
    seed: int, slow: bool, comparison: Comparison
) -> None:
    if not slow and seed not in BOUNDED:
        pytest.skip("with --slow")
    found = comparison(lambda size: drawn(seed, size))
    assert left(found.quick)
    shown = {c.model: c.chi2 or 0.0 for c in found.quick.candidates}
    least = min(c.chi2 or 0.0 for c in found.whole.candidates)
    for one in in_both(found.quick, found.whole):
        assert one.chi2 is not None
        if one.chi2 < OUT_OF_QUESTION * least:
            assert shown[one.model] < MOST_ABOVE * one.chi2, one.model


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_so_it_is_where_points_share_errors(seed: int, slow: bool, comparison: Comparison) -> None:
    if not slow and seed not in BOUNDED_WITH_SHARED:
        pytest.skip("with --slow")
    found = comparison(lambda size: with_shared_errors(drawn(seed, size), seed))
    assert left(found.quick) or seed % 2


def left(choice: Choice) -> list[str]:
    """Names of the candidates that were not fitted to all points."""
    return [c.model for c in choice.candidates if c.message == first_fit.LEFT]


def test_a_point_costs_no_more_among_many() -> None:
    """A named model, with errors that points share: nothing of the fit grows as their square."""
    few, many = (with_shared_errors(drawn(2, size), 2) for size in (8_000, 32_000))
    model = MODELS[MATERIALS[2]]
    seconds = [(time_s(model, few), time_s(model, many)) for _ in range(2)]
    few_s, many_s = np.min(seconds, axis=0)
    assert many_s / many.size < MOST_A_POINT * few_s / few.size


def time_s(model: Model, m: Measurements) -> float:
    """Time of a fit in s of processor, once it explains the data."""
    begun_s = time.process_time()
    found = fit(model, m)
    spent_s = time.process_time() - begun_s
    assert found.chi2 == pytest.approx(m.size, rel=0.1)
    return spent_s


def require_same_choice(quick: Choice, whole: Choice) -> None:
    """Fail where two searches choose another model or other values.

    Unless the quick search finds a deeper minimum of a model: then its choice is the better.
    """
    assert quick.best is not None
    assert whole.best is not None
    shown = {c.model: c.chi2 or 0.0 for c in quick.candidates}
    deeper = [c for c in in_both(quick, whole) if shown[c.model] < DEEPER * (c.chi2 or 0.0)]
    assert quick.verdict == whole.verdict
    if deeper:
        assert quick.best.bic <= whole.best.bic + ROUNDING_OF_BIC
    else:
        assert quick.chosen == whole.chosen
        for name, u in whole.best.u.items():
            if u is not None:
                assert abs(quick.best.values[name] - whole.best.values[name]) < 0.1 * u, name
    assert all(c.converged or c.message == first_fit.LEFT for c in quick.candidates)


def in_both(quick: Choice, whole: Choice) -> list[FitResult]:
    """The candidates of a search, but for integrated models that the other one left out.

    That may find one no more accurate than its functional form.
    """
    names = {c.model for c in quick.candidates}
    return [c for c in whole.candidates if c.model in names or not functional_form(c.model)]
