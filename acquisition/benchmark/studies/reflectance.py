"""Reflectance methods: nanoseconds a geometry against the error to the exact reflectance.

Three studies: the rough diffuse surface of 1995, Wolff's dielectric of 1998, the physical optics
of 1991. `ROUGH`, `WOLFF` and `BECKMANN` list the methods; to measure another one, add it there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from acquisition.benchmark.effort import Effort
from acquisition.benchmark.number_text import percent, rounded, short
from acquisition.benchmark.peers import lambertian_peers
from acquisition.benchmark.studies import reflectance_truth as truth
from acquisition.benchmark.study import Study
from acquisition.benchmark.timing import Timed, timed
from acquisition.benchmark.trial import Trial
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
from analysis.models.smooth.chandrasekhar import h_order
from analysis.models.smooth.fresnel import transmittance
from analysis.models.smooth.wolff import wolff_brdf
from analysis.models.specular.beckmann_spizzichino import (
    geometric_factor,
    lobe_brdf,
    optical_roughness,
    rough_lobe_brdf,
    smooth_lobe_brdf,
    wave_vector,
)
from instrument.geometry import FloatArray, Geometry

Brdf = Callable[..., FloatArray]
ALBEDO = 0.8
FUNCTIONAL = "functional (33)+(34)"
SIGMAS_DEG = (10.0, 20.0, 40.0)
MOST_DEG = 75.0  # the papers measure and plot up to 75 degrees
RHOS, INDEX = (0.5, 0.9, 0.99), 1.5
SURFACES = ((0.05, 3.0), (0.5, 10.0), (3.0, 30.0))  # sigma_h and correlation length, wavelengths
_FEW = 256  # geometries at once where each takes a tenth of a millisecond
LEAST = 1e-3  # of the brightest: below it a lobe's error counts as if it were as bright


@dataclass(frozen=True, slots=True)
class Method:
    """A way to a BRDF: `brdf(geometry, *parameters)`; `before` goes before each timed call.

    Each call gets a geometry of which nothing has been kept, but where it is `known`.
    """

    series: str
    label: str
    brdf: Brdf
    default: bool = False
    peer: bool = False
    known: bool = False
    before: Callable[[], object] | None = None
    note: str = ""


def _named(name: str) -> Brdf:
    return lambda geometry, albedo, sigma_deg: MODELS[name].brdf(
        geometry, albedo=albedo, sigma_deg=sigma_deg
    )


def _lambert(geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    del sigma_deg
    return MODELS["lambert"].brdf(geometry, albedo=albedo)


def _exact(rule: Rule) -> Brdf:
    return lambda geometry, albedo, sigma_deg: oren_nayar_exact_brdf(
        geometry, albedo, sigma_deg, rule
    )


_RULES = {"1e-4": COARSE, "1e-6": RULE, "1e-8": FINE}

ROUGH: tuple[Method, ...] = (
    Method("closed form", "Lambert", _lambert),
    Method("closed form", "qualitative (36)", _named("oren_nayar_qualitative")),
    Method("closed form", FUNCTIONAL, _named("oren_nayar"), default=True),
    Method("table", "table", tabulated_brdf, note="cubic splines over four angles"),
    *(
        Method(
            "exact, angles known", f"exact {accuracy}", _exact(rule), accuracy == "1e-6",
            known=True, note="a new sigma or albedo where the angles have been met, as in a fit",
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


def wolff_of_order(geometry: Geometry, rho: float, n: float, order: int) -> FloatArray:
    """Wolff's BRDF in 1/sr, (7) with (8), with H in the N-th order form; exact F.

    K goes by a Chebyshev series in the cosine, as it does where H is exact.
    """
    theta = np.stack([geometry.theta_i, geometry.theta_r])
    mu = np.sqrt(1 - np.square(np.sin(theta) / n))
    H = h_order(mu, rho, order)
    varrho_1 = rho / (4 * np.pi * n * n) * H[0] * H[1] / (mu[0] + mu[1])
    K = np.asarray(_return(rho, n, order)(mu[1]), dtype=np.float64)
    through = transmittance(theta, n)
    return np.asarray(varrho_1 / (1 - K) * through[0] * through[1])


@cache
def _return(rho: float, n: float, order: int) -> np.polynomial.Chebyshev:
    """K of (8) over the cosine inside, with H of that order."""
    t, w = np.polynomial.legendre.leggauss(24)
    t, w = (t + 1) / 2, w / 2
    critical = np.sqrt(1 - 1 / n**2)
    below, beyond = critical * t, np.sqrt(1 - (1 - t * t) / n**2)
    x = np.concatenate([below, beyond])
    lost = np.concatenate([np.zeros_like(t), transmittance(np.arccos(t), n)])
    weight = np.concatenate([critical * w * below, w * t / (n * n)])
    weight = weight * (1 - lost) * h_order(x, rho, order)

    def exact(at: FloatArray) -> FloatArray:
        return np.asarray(rho / 2 * h_order(at, rho, order) * ((1 / (x + at[:, None])) @ weight))

    return np.polynomial.Chebyshev.interpolate(exact, 16, domain=[critical, 1.0])


WOLFF: tuple[Method, ...] = (
    *(
        Method("H of order N, exact F", f"order {order}", partial(wolff_of_order, order=order))
        for order in (1, 2, 4, 8, 16)
    ),
    Method(
        "exact H", "polynomial F", partial(wolff_brdf, epsilon=0.07), note="Wolff's for n = 1.5"
    ),
    Method("exact H", "exact H and F", wolff_brdf, default=True),
)


def terms(
    geometry: Geometry, scale: float, sigma_h: float, correlation_length: float, count: int
) -> FloatArray:
    """The lobe in 1/sr by a fixed number of terms of (77): the paper sums 100."""
    g = optical_roughness(geometry, sigma_h)
    v_x, v_y, _ = wave_vector(geometry)
    q = (np.square(v_x) + np.square(v_y)) * correlation_length**2 / 4
    ratio = np.cos(geometry.theta_i) / np.cos(geometry.theta_r)
    with np.errstate(under="ignore"):
        poisson, total = np.exp(-g), np.zeros(g.shape)
        for m in range(1, count + 1):
            poisson = poisson * (g / m)
            total += poisson * np.exp(-q / m) / m
    D = geometric_factor(geometry)
    return np.asarray(scale * np.pi * correlation_length**2 * ratio * np.square(D) * total)


BECKMANN: tuple[Method, ...] = (
    Method("limit", "smooth (78)", smooth_lobe_brdf),
    Method("limit", "rough (79)", rough_lobe_brdf),
    Method("fixed sum", "10 terms", partial(terms, count=10)),
    Method("fixed sum", "100 terms", partial(terms, count=100)),
    Method("adaptive sum", "adaptive sum", lobe_brdf, default=True),
)


def rough_study(effort: Effort) -> Study:
    """The rough diffuse surface, at three roughnesses."""
    probe, batch = _everywhere(effort)
    name, trials = "rough_surface", list[Trial]()
    peers = [
        Method("another program", f"Lambert, {peer}", _of_peer(brdf), peer=True)
        for peer, brdf in lambertian_peers(ALBEDO).items()
    ]
    true = truth.rough_surface(probe, ALBEDO, SIGMAS_DEG)
    for method in (*ROUGH, *peers):  # not scene by scene: what is known of the angles stays so
        for n, sigma_deg in enumerate(SIGMAS_DEG):
            time = run(method, batch, effort.repeats, ALBEDO, sigma_deg)
            trials.append(_trial(name, f"σ = {sigma_deg:g}°", method, time, true[n]))
    clear_profile_cache()
    trials.sort(key=lambda t: float(t.scene.strip("σ =°")))
    return Study(
        name,
        "Rough diffuse surface: which form of Oren and Nayar’s model",
        "time per geometry (ns)",
        "relative error, worst",
        _rough_caption(trials),
        f"adaptive quadrature of the printed integral (31), good to 1e-9; angles up to "
        f"{MOST_DEG:g}°, all azimuths, albedo {ALBEDO:g}",
        tuple(trials),
    )


def _rough_caption(trials: Sequence[Trial]) -> str:
    def worst(label: str) -> float:
        return max(t.error for t in trials if t.label == label)

    def cost(label: str) -> float:
        return float(np.median([t.cost for t in trials if t.label == label]))

    typical = max(t.error_median for t in trials if t.label == FUNCTIONAL)
    known, new = (cost(label) / cost(FUNCTIONAL) for label in ("exact 1e-6", "exact 1e-6, first"))
    return (
        f"The functional form is off by up to {percent(typical)} at a typical angle and "
        f"{percent(worst(FUNCTIONAL))} at the worst, far forward; the integral by "
        f"{short(worst('exact 1e-6'))}, promised 1e-6.\nWhere the angles have been met before, as "
        f"in a fit, the integral costs {rounded(known)} times the functional form; at new angles "
        f"{rounded(new)} times."
    )


def _of_peer(lambertian: Brdf) -> Brdf:
    def brdf(geometry: Geometry, *parameters: float) -> FloatArray:
        del parameters  # it was made with the albedo
        return lambertian(geometry)

    return brdf


def wolff_study(effort: Effort) -> Study:
    """Wolff's dielectric, at three single-scattering albedos."""
    probe, batch = _everywhere(effort)
    name, trials = "wolff", list[Trial]()
    for rho in RHOS:
        true = truth.wolff(probe, rho, INDEX)
        for method in WOLFF:
            time = run(method, batch, effort.repeats, rho, INDEX)
            trials.append(_trial(name, f"ϱ = {rho:g}", method, time, true))
    return Study(
        name,
        "Smooth dielectric: how Wolff’s H and F are worked out",
        "time per geometry (ns)",
        "relative error, worst",
        _wolff_caption(trials),
        "H by iteration of Chandrasekhar’s integral equation, F from the amplitudes; "
        f"n = {INDEX:g}",
        tuple(trials),
    )


def _wolff_caption(trials: Sequence[Trial]) -> str:
    exact = float(np.median([t.cost for t in trials if t.default]))
    order, polynomial = (
        [t for t in trials if t.label == label] for label in ("order 16", "polynomial F")
    )
    times = float(np.median([t.cost for t in order])) / exact
    return (
        "Exact H and F are kept as a series in the cosine: they cost as much as a product of a few "
        f"factors. H of order 16 costs {rounded(times)} times as much and is still off by up "
        f"to {percent(max(t.error for t in order))}.\nWolff’s polynomial for F is off by up to "
        f"{percent(max(t.error for t in polynomial))} at oblique angles, whatever is done about "
        "H, and saves next to nothing."
    )


def beckmann_study(effort: Effort) -> Study:
    """Physical optics, on a smooth, a middling and a rough surface."""
    probe, batch = _near_mirror(effort)
    name, trials = "beckmann", list[Trial]()
    for lengths in SURFACES:
        true = truth.beckmann(probe, *lengths)
        g = float(np.median(optical_roughness(probe, lengths[0])))
        scene = f"σₕ = {lengths[0]:g} λ (g ≈ {float(f'{g:.1g}'):g})"
        for method in BECKMANN:
            time = run(method, batch, effort.repeats, 1.0, *lengths)
            trials.append(_trial(name, scene, method, time, true))
    return Study(
        name,
        "Physical optics: how Beckmann’s sum is worked out",
        "time per geometry (ns)",
        "relative error, worst",
        "The two limits are cheap and right only at their own end of roughness; 100 terms are too "
        "few from g ≈ 70 on and give nothing at all on a rough surface.\nThe adaptive sum is off "
        f"by {short(max(t.error for t in trials if t.default))} at the worst, at any roughness, "
        "for about what 100 terms cost.",
        "the sum (77) in 40 digits, within 15° of the mirror direction; below a thousandth of the "
        "brightest, errors relative to that",
        tuple(trials),
    )


def run(method: Method, batch: Geometry, repeats: int, *parameters: float) -> Timed[FloatArray]:
    """Time a method on a batch, a part of it where a call takes long: seconds, per batch."""
    size = _FEW if method.before is not None else batch.theta_i_deg.size
    arrays = tuple(a[:size] for a in (batch.theta_i_deg, batch.theta_r_deg, batch.dphi_deg))
    return timed(lambda: method.brdf(Geometry(*arrays), *parameters), repeats, method.before)


def _trial(
    study: str,
    scene: str,
    method: Method,
    time: Timed[FloatArray],
    true: FloatArray,
) -> Trial:
    """The errors are those of the values that were timed: the probes lead the batch."""
    off = np.abs(time.value[: true.size] - true) / np.maximum(true, LEAST * true.max())
    return Trial(
        study,
        scene,
        method.series,
        method.label,
        1e9 * time.least_s / time.value.size,
        float(np.max(off)),
        float(np.median(off)),
        method.default,
        method.peer,
        note=method.note,
        more={"spread_of_cost": time.spread},
    )


def _everywhere(effort: Effort) -> tuple[Geometry, Geometry]:
    """Probes all over the hemispheres, a third in the plane of incidence; and the batch."""
    random = np.random.default_rng(7)
    theta_i, theta_r = random.uniform(0, MOST_DEG, (2, effort.batch))
    dphi = random.uniform(0, 360, effort.batch)
    dphi[::6], dphi[3::6] = 0, 180
    theta_i[:4], theta_r[:4] = (75, 75, 60, 30), (60, 75, 60, 75)
    dphi[:4] = (180, 180, 0, 90)
    return _probes(theta_i, theta_r, dphi, effort.truths)


def _near_mirror(effort: Effort) -> tuple[Geometry, Geometry]:
    """Probes within 15 degrees of the mirror direction."""
    random = np.random.default_rng(8)
    theta_i = random.uniform(0, 60, effort.batch)
    theta_r = np.abs(theta_i + random.uniform(-12, 12, effort.batch))
    dphi = 180 + random.uniform(-9, 9, effort.batch)
    theta_r[0], dphi[0] = theta_i[0], 180
    return _probes(theta_i, theta_r, dphi, effort.truths)


def _probes(
    theta_i: FloatArray, theta_r: FloatArray, dphi: FloatArray, count: int
) -> tuple[Geometry, Geometry]:
    angles: Sequence[FloatArray] = (theta_i, theta_r, dphi)
    first, all_of_them = (
        Geometry.from_degrees(theta_i=angles[0][:n], theta_r=angles[1][:n], dphi=angles[2][:n])
        for n in (count, theta_i.size)
    )
    return first, all_of_them
