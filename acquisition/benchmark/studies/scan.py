"""Scan settings: time on the bench against the error of the fitted parameters.

The whole program measures a simulated sample of known parameters with many seeds: each has its own
noise and its own errors of angles, tile and placement. Two lower limits (Cramer and Rao) for any
unbiased method stand beside it: one from photon noise alone, one from all stated uncertainties.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from acquisition.benchmark.demo_scan import (
    BINNING,
    demonstration,
    reduced_scan,
    sample_of,
    view_step_deg,
)
from acquisition.benchmark.effort import Effort
from acquisition.benchmark.number_text import percent, rounded
from acquisition.benchmark.studies.method import rms_and_median
from acquisition.benchmark.study import Study
from acquisition.benchmark.trial import Trial, select
from acquisition.measure.window import window_at
from acquisition.plan.exposure_ladder import longest_exposure_s
from acquisition.plan.plan import Plan, make_plan
from acquisition.results.fitting import measurements
from analysis.data.acceptance import Acceptance
from analysis.data.covariance import Covariance
from analysis.fit.fit import fit, stated_u
from analysis.fit.search.problem import Problem
from analysis.models import MODELS
from instrument.config.load import Loaded
from instrument.geometry import FloatArray, Geometry
from instrument.pinhole import Pinhole

_OWN, _PHOTONS, _STATED = "demonstration", "photons", "u_stated_relative"
_WORDS = {"sigma_deg": "roughness σ", "albedo": "albedo"}


@dataclass(frozen=True, slots=True)
class Settings:
    """View angles per incidence, frames per point, exposure target; None: as in the demo."""

    views: int | None = None
    frames: int | None = None
    exposure_target: float | None = None


DEFAULT = Settings()
VIEWS: tuple[int, ...] = (9, 17, 65, 129)
FRAMES: tuple[int, ...] = (1, 2, 8, 16)
TARGETS: tuple[float, ...] = (0.05, 0.2, 0.4)
_QUICK = VIEWS[1:2], FRAMES[:1], TARGETS[:1]


def variants(thorough: bool) -> list[tuple[str, str, Settings]]:
    """Return series, label and settings: the demonstration, then one setting changed at a time."""
    views, frames, targets = (VIEWS, FRAMES, TARGETS) if thorough else _QUICK
    return [
        (_OWN, _OWN, DEFAULT),
        *(("step", f"step {view_step_deg(n):g}°", Settings(views=n)) for n in views),
        *(("frames", f"{n} frame{'s' * (n > 1)}", Settings(frames=n)) for n in frames),
        *(("exposure", f"exposed to {t:.0%}", Settings(exposure_target=t)) for t in targets),
    ]


def scan_study(effort: Effort) -> Study:
    """Compare all settings, each with the same number of seeds."""
    trials: list[Trial] = []
    with TemporaryDirectory(prefix="gonio-bench-") as folder:
        for series, label, settings in variants(effort.thorough):
            found = simulated(settings, effort.seeds, Path(folder) / label)
            trials += _trials(series, label, settings, *found)
    return Study(
        name="scan",
        title="Scan: what more angles, frames and light bring",
        cost_axis="time on the bench (minutes)",
        error_axis="relative error, rms over scans",
        caption=_caption(trials),
        truth=f"the simulated sample’s own parameters, {effort.seeds} scans of each setting (an "
        f"rms good to {percent(1 / math.sqrt(2 * effort.seeds))}), pixels binned {BINNING} × "
        f"{BINNING}; limits after Cramér and Rao",
        trials=tuple(trials),
        error_is="rms",
    )


def _caption(trials: Sequence[Trial]) -> str:
    own = {t.scene: t for t in select(trials, default=True)}
    photons = {t.scene: t.error for t in select(trials, label=f"{_PHOTONS}: {_OWN}")}
    reached = ", ".join(
        f"{percent(t.more[_STATED])} for the {scene} "
        f"({rounded(t.more[_STATED] / photons[scene])} times the photon limit)"
        for scene, t in own.items()
    )

    def others(parameter: str) -> list[tuple[Trial, float]]:
        """Trials of other settings, and their stated u in units of the demonstration's."""
        scene = _WORDS[parameter]
        found = [t for t in select(trials, scene=scene, default=False) if not t.bound]
        return [(t, t.more[_STATED] / own[scene].more[_STATED]) for t in found]

    ends = _ends([t for t, _ in others("sigma_deg")])
    words = ", ".join(
        f"{t.label} {rounded(ratio)} times in {rounded(t.cost)} min"
        for t, ratio in others("sigma_deg")
        if t in ends
    )
    ratios = [ratio for _, ratio in others("albedo")]
    change = f"{rounded(min(ratios))} to {rounded(max(ratios))}"
    minutes = own[_WORDS["sigma_deg"]].cost
    return (
        f"The demonstration states a u of {reached}, in {rounded(minutes)} minutes. The albedo’s u "
        "is mostly shared by all points (tile, lamp, placement): other settings change it by "
        f"factors of only {change}.\nThe roughness’s stated u, in comparison: {words}."
    )


def _ends(trials: Sequence[Trial]) -> list[Trial]:
    """Return the cheapest and the most expensive trial of each series."""
    ends: list[Trial] = []
    for series in dict.fromkeys(t.series for t in trials):
        own = sorted((t for t in trials if t.series == series), key=lambda t: t.cost)
        ends += [own[0], own[-1]]
    return ends


def simulated(settings: Settings, seeds: int, folder: Path) -> tuple[FloatArray, FloatArray]:
    """Scan, reduce and fit with the sample's own model, once for each seed.

    Returns the errors of the parameters and their stated u, both relative to the truth, as
    (seeds, parameters) in the order of `_WORDS`.
    """
    errors, stated = [], []
    for seed in range(1, seeds + 1):
        loaded = demonstration(**asdict(settings), seed=seed)
        values, u = _once(loaded, folder / str(seed))
        truth = sample_of(loaded).parameters
        errors.append([values[name] / truth[name] - 1 for name in _WORDS])
        stated.append([u[name] / truth[name] for name in _WORDS])
    return np.array(errors), np.array(stated)


def _once(loaded: Loaded, folder: Path) -> tuple[dict[str, float], dict[str, float]]:
    """Return parameters and their u from one simulated scan by the program's own engine."""
    points = measurements(reduced_scan(loaded, folder), loaded)
    model = MODELS[sample_of(loaded).model]
    found = fit(model, points, Acceptance.of(loaded.rig, loaded.protocol.window))
    return dict(found.values), stated_u(found, points)


def photon_limit(loaded: Loaded, plan: Plan) -> dict[str, float]:
    """Return the least u of the parameters allowed by photon and read noise (Cramer and Rao).

    The inverse of the Fisher information J^T C^-1 J, with J the derivatives of the model and C the
    variance of the electrons that the plan's exposures collect in the window.
    """
    model, truth = MODELS[sample_of(loaded).model], sample_of(loaded).parameters
    poses = [step.pose for step in plan.points]
    geometry = Geometry.from_degrees(
        theta_i=[p.theta_i for p in poses],
        theta_r=[p.theta_r for p in poses],
        dphi=[p.dphi for p in poses],
    )
    brdf = model.brdf(geometry, **truth)
    variance = np.square(brdf * _noise(brdf, geometry, loaded, plan))
    problem = Problem(model, geometry, brdf, Covariance(variance, np.zeros((brdf.size, 0))))
    J = problem.jacobian(np.array([truth[p.name] for p in model.parameters]))
    u = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    return {p.name: float(value) for p, value in zip(model.parameters, u, strict=True)}


def _noise(brdf: FloatArray, geometry: Geometry, loaded: Loaded, plan: Plan) -> FloatArray:
    """Relative noise of every point, from the electrons in its window."""
    camera, protocol = loaded.rig.camera, loaded.protocol
    per_s = loaded.rig.lamp.white_electrons_per_s * np.pi * brdf * np.cos(geometry.theta_i)
    wanted = protocol.exposure_target * camera.full_well_electrons / per_s
    electrons = per_s * [longest_exposure_s(float(limit), camera) for limit in wanted]
    pinhole, patch = Pinhole.of(loaded.rig), protocol.window
    pixels = [
        window_at(step.pose.theta_r, pinhole, patch.width_mm, patch.height_mm).pixels
        for step in plan.points
    ]
    counted = np.array(pixels) * protocol.frames_per_point
    variance = electrons + camera.read_noise_electrons**2
    return np.asarray(np.sqrt(variance / counted) / electrons)


def _trials(
    series: str, label: str, settings: Settings, errors: FloatArray, stated_u: FloatArray
) -> list[Trial]:
    loaded = demonstration(**asdict(settings))
    plan = make_plan(loaded)
    truth, photons = sample_of(loaded).parameters, photon_limit(loaded, plan)
    trials: list[Trial] = []
    for column, (name, scene) in enumerate(_WORDS.items()):
        own_errors, stated = errors[:, column], float(np.median(stated_u[:, column]))
        own = Trial(
            study="scan",
            scene=scene,
            series=series,
            label=label,
            cost=plan.duration_s / 60,
            default=settings == DEFAULT,
            more={
                "bias_relative": float(own_errors.mean()),
                "u_bias_relative": float(own_errors.std(ddof=1) / math.sqrt(own_errors.size)),
                _STATED: stated,
                "geometries": float(len(plan.points)),
            },
            **rms_and_median(own_errors),
        )
        limits = {_PHOTONS: photons[name] / truth[name], "all parts of u": stated}
        trials += [own, *(_limit(own, what, value) for what, value in limits.items())]
    return trials


def _limit(trial: Trial, what: str, value: float) -> Trial:
    """Return a limit to a trial's error, at the same cost."""
    return Trial(
        study=trial.study, scene=trial.scene, series=f"limit: {what}",
        label=f"{what}: {trial.label}", cost=trial.cost, error=value, error_median=value,
        bound=True,
    )  # fmt: skip
