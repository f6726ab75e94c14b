"""Reflectance methods: time per geometry against the error to the exact reflectance.

Three studies: the rough diffuse surface of 1995, Wolff's dielectric of 1998, the physical optics
of 1991. `ROUGH`, `WOLFF` and `BECKMANN` list the methods; to measure another one, add it there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from acquisition.benchmark.effort import Effort
from acquisition.benchmark.maps.beckmann_lobe import first_terms_brdf
from acquisition.benchmark.maps.smooth_dielectric import EPSILON
from acquisition.benchmark.number_text import percent, rounded, short
from acquisition.benchmark.peers import lambertian_peers
from acquisition.benchmark.studies import reflectance_truth as truth
from acquisition.benchmark.studies.method import Method
from acquisition.benchmark.study import Study
from acquisition.benchmark.timing import timed
from acquisition.benchmark.trial import Trial, select
from analysis.models import MODELS
from analysis.models.rough.form_error_table import tabulated_brdf
from analysis.models.rough.oren_nayar_exact import (
    COARSE,
    FINE,
    RULE,
    Rule,
    clear_profile_cache,
    oren_nayar_exact_brdf,
)
from analysis.models.smooth.wolff import wolff_brdf
from analysis.models.specular.beckmann_spizzichino import (
    lobe_brdf,
    optical_roughness,
    rough_lobe_brdf,
    smooth_lobe_brdf,
)
from instrument.geometry import Brdf, FloatArray, Geometry

ParametricBrdf = Callable[..., FloatArray]
"""BRDF in 1/sr from a geometry and the parameters of the study, by position."""

ALBEDO = 0.8
FUNCTIONAL = "functional (33)+(34)"
SIGMAS_DEG = (10.0, 20.0, 40.0)
MOST_DEG = 75.0  # the papers measure and plot up to 75 degrees
RHOS, INDEX = (0.5, 0.9, 0.99), 1.5
SURFACES = ((0.05, 3.0), (0.5, 10.0), (3.0, 30.0))  # sigma_h and correlation length, wavelengths
_FEW = 256  # geometries in a call where each takes a tenth of a millisecond
LEAST = 1e-3  # of the brightest: darker values are compared as if they were this bright


def _model(name: str) -> ParametricBrdf:
    return lambda geometry, albedo, sigma_deg: MODELS[name].brdf(
        geometry, albedo=albedo, sigma_deg=sigma_deg
    )


def _lambertian(brdf: Brdf) -> ParametricBrdf:
    """Return a BRDF made with ALBEDO as one that takes albedo and roughness, and ignores both."""
    return lambda geometry, *_: brdf(geometry)


def _exact(rule: Rule) -> ParametricBrdf:
    return lambda geometry, albedo, sigma_deg: oren_nayar_exact_brdf(
        geometry, albedo, sigma_deg, rule
    )


_RULES = {"1e-4": COARSE, "1e-6": RULE, "1e-8": FINE}

ROUGH: tuple[Method[ParametricBrdf], ...] = (
    Method(
        "closed form", "Lambert", _lambertian(partial(MODELS["lambert"].brdf, albedo=ALBEDO))
    ),
    Method("closed form", "qualitative (36)", _model("oren_nayar_qualitative")),
    Method("closed form", FUNCTIONAL, _model("oren_nayar"), default=True),
    Method("table", "table", tabulated_brdf, note="cubic splines over four angles"),
    *(
        Method(
            "exact, angles known", f"exact {accuracy}", _exact(rule), default=accuracy == "1e-6",
            note="a new sigma or albedo at angles already met, as in a fit",
        )
        for accuracy, rule in _RULES.items()
    ),
    *(
        Method(
            "exact, first time", f"exact {accuracy}, first", _exact(rule),
            before=clear_profile_cache,
            note="angles met for the first time",
        )
        for accuracy, rule in _RULES.items()
    ),
)  # fmt: skip

WOLFF: tuple[Method[ParametricBrdf], ...] = (
    *(
        Method("H of order N, exact F", f"order {order}", partial(wolff_brdf, order=order))
        for order in (1, 2, 4, 8, 16)
    ),
    Method(
        "exact H", "polynomial F", partial(wolff_brdf, epsilon=EPSILON), note="Wolff's for n = 1.5"
    ),
    Method("exact H", "exact H and F", wolff_brdf, default=True),
)

BECKMANN: tuple[Method[ParametricBrdf], ...] = (
    Method("limit", "smooth (78)", smooth_lobe_brdf),
    Method("limit", "rough (79)", rough_lobe_brdf),
    Method("fixed sum", "10 terms", partial(first_terms_brdf, count=10)),
    Method("fixed sum", "100 terms", partial(first_terms_brdf, count=100)),
    Method("adaptive sum", "adaptive sum", lobe_brdf, default=True),
)


def _study(name: str, trials: Sequence[Trial], *, title: str, caption: str, truth: str) -> Study:
    return Study(
        name=name, title=title, cost_axis="time per geometry (ns)",
        error_axis="relative error, worst", caption=caption, truth=truth, trials=tuple(trials),
    )  # fmt: skip


def rough_study(effort: Effort) -> Study:
    """Compare methods for the rough diffuse surface at three roughnesses."""
    probe, batch = _everywhere(effort)
    name, trials = "rough_surface", list[Trial]()
    peers = [
        Method("another program", f"Lambert, {peer}", _lambertian(brdf), peer=True)
        for peer, brdf in lambertian_peers(ALBEDO).items()
    ]
    true = truth.rough_surface(probe, ALBEDO, SIGMAS_DEG)
    for method in (*ROUGH, *peers):  # sigmas inside: the exact method keeps its sums of the angles
        for n, sigma_deg in enumerate(SIGMAS_DEG):
            scene, parameters = f"σ = {sigma_deg:g}°", (ALBEDO, sigma_deg)
            trials.append(_trial(name, scene, method, batch, effort.repeats, true[n], *parameters))
    clear_profile_cache()
    trials.sort(key=lambda t: float(t.scene.strip("σ =°")))
    return _study(
        name,
        trials,
        title="Rough diffuse surface: which form of Oren and Nayar’s model",
        caption=_rough_caption(trials),
        truth="adaptive quadrature of the printed integral (31), accurate to 1e-9; angles up to "
        f"{MOST_DEG:g}°, all azimuths, albedo {ALBEDO:g}",
    )


def _rough_caption(trials: Sequence[Trial]) -> str:
    def worst(label: str) -> float:
        return max(t.error for t in select(trials, label=label))

    def cost(label: str) -> float:
        return float(np.median([t.cost for t in select(trials, label=label)]))

    typical = max(t.error_median for t in select(trials, label=FUNCTIONAL))
    known, new = (cost(label) / cost(FUNCTIONAL) for label in ("exact 1e-6", "exact 1e-6, first"))
    return (
        f"The functional form is off by up to {percent(typical)} at a typical angle and by "
        f"{percent(worst(FUNCTIONAL))} at the worst one, far forward; the integral by "
        f"{short(worst('exact 1e-6'))} (specified: 1e-6).\nAt angles met before, as in a fit, the "
        f"integral costs {rounded(known)} times the functional form; at new angles "
        f"{rounded(new)} times."
    )


def wolff_study(effort: Effort) -> Study:
    """Compare methods for Wolff's dielectric at three single-scattering albedos."""
    probe, batch = _everywhere(effort)
    name, trials = "wolff", list[Trial]()
    for rho in RHOS:
        scene, true = f"ϱ = {rho:g}", truth.wolff(probe, rho, INDEX)
        trials += [_trial(name, scene, m, batch, effort.repeats, true, rho, INDEX) for m in WOLFF]
    return _study(
        name,
        trials,
        title="Smooth dielectric: how to compute Wolff’s H and F",
        caption=_wolff_caption(trials),
        truth="H by iteration of Chandrasekhar’s integral equation, F from the amplitudes; "
        f"n = {INDEX:g}",
    )


def _wolff_caption(trials: Sequence[Trial]) -> str:
    exact = float(np.median([t.cost for t in select(trials, default=True)]))
    order, polynomial = (select(trials, label=label) for label in ("order 16", "polynomial F"))
    times = float(np.median([t.cost for t in order])) / exact
    return (
        "H and K are kept as series in the cosine, so that they cost as much as a product of a few "
        f"factors. H of order 16, kept in the same way, takes {rounded(times)} times as long as "
        f"the exact one and is still off by up to {percent(max(t.error for t in order))}.\n"
        f"Wolff’s polynomial for F is off by up to {percent(max(t.error for t in polynomial))} at "
        "oblique angles, whichever H is used, and saves next to nothing."
    )


def beckmann_study(effort: Effort) -> Study:
    """Compare methods for physical optics on a smooth, an intermediate and a rough surface."""
    probe, batch = _near_mirror(effort)
    name, trials = "beckmann", list[Trial]()
    for lengths in SURFACES:
        true = truth.beckmann(probe, *lengths)
        g = float(np.median(optical_roughness(probe, lengths[0])))
        scene = f"σₕ = {lengths[0]:g} λ (g ≈ {float(f'{g:.1g}'):g})"
        trials += [
            _trial(name, scene, m, batch, effort.repeats, true, 1.0, *lengths) for m in BECKMANN
        ]
    worst = short(max(t.error for t in select(trials, default=True)))
    return _study(
        name,
        trials,
        title="Physical optics: how to compute Beckmann’s sum",
        caption="The two limits are cheap, and right only at their own end of roughness; 100 terms "
        "are too few from g ≈ 70 on and give nothing at all on a rough surface.\nThe adaptive sum "
        f"is off by {worst} at the worst, at any roughness, for about the cost of 100 terms.",
        truth="the sum (77) in 40 digits, within 15° of the mirror direction; below a thousandth "
        "of the brightest value, errors are relative to that thousandth",
    )


def _trial(
    study: str,
    scene: str,
    method: Method[ParametricBrdf],
    batch: Geometry,
    repeats: int,
    true: FloatArray,
    *parameters: float,
) -> Trial:
    """Time a method on a batch, or on its first geometries if it is slow.

    Each call gets a new `Geometry`, for which nothing is cached yet. The errors are those of the
    timed values, at the head of the batch.
    """
    size = _FEW if method.before is not None else batch.theta_i_deg.size
    arrays = tuple(a[:size] for a in (batch.theta_i_deg, batch.theta_r_deg, batch.dphi_deg))
    time = timed(lambda: method.call(Geometry(*arrays), *parameters), repeats, method.before)
    errors = (time.value[: true.size] - true) / np.maximum(true, LEAST * true.max())
    return method.timed_trial(study, scene, time, 1e9, errors)


def _everywhere(effort: Effort) -> tuple[Geometry, Geometry]:
    """Return probes over the whole hemispheres, a third in the plane of incidence; and a batch."""
    random = np.random.default_rng(7)
    theta_i, theta_r = random.uniform(0, MOST_DEG, (2, effort.batch))
    dphi = random.uniform(0, 360, effort.batch)
    dphi[::6], dphi[3::6] = 0, 180
    theta_i[:4], theta_r[:4] = (75, 75, 60, 30), (60, 75, 60, 75)
    dphi[:4] = (180, 180, 0, 90)
    return _probes(theta_i, theta_r, dphi, effort.truths)


def _near_mirror(effort: Effort) -> tuple[Geometry, Geometry]:
    """Return probes within 15 degrees of the mirror direction, and a batch."""
    random = np.random.default_rng(8)
    theta_i = random.uniform(0, 60, effort.batch)
    theta_r = np.abs(theta_i + random.uniform(-12, 12, effort.batch))
    dphi = 180 + random.uniform(-9, 9, effort.batch)
    theta_r[0], dphi[0] = theta_i[0], 180
    return _probes(theta_i, theta_r, dphi, effort.truths)


def _probes(
    theta_i: FloatArray, theta_r: FloatArray, dphi: FloatArray, count: int
) -> tuple[Geometry, Geometry]:
    """Return the first `count` geometries, and all of them."""
    batch = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    first = (a[:count] for a in (batch.theta_i_deg, batch.theta_r_deg, batch.dphi_deg))
    return Geometry(*first), batch
