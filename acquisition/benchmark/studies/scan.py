"""What a scan's settings cost and bring: minutes on the bench against the error of the parameters.

The whole program measures a simulated sample, whose parameters are known, with many seeds: other
noise, other errors of angles, tile and placing. Beside it stand two limits for any unbiased method
(Cramer and Rao): what the photons allow, and what all stated uncertainties allow.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from acquisition.benchmark.demo_scan import BINNING, demonstration
from acquisition.benchmark.effort import Effort
from acquisition.benchmark.number_text import percent, rounded
from acquisition.benchmark.study import Study
from acquisition.benchmark.trial import Trial
from acquisition.engine.engine import Engine
from acquisition.measure.window import window_at
from acquisition.plan.exposure_ladder import longest_exposure_s
from acquisition.plan.plan import Plan, Step, make_plan
from acquisition.results.fitting import measurements
from acquisition.results.reduction import reduced_run
from acquisition.rig import open_devices
from analysis.data.acceptance import Acceptance
from analysis.data.covariance import Covariance
from analysis.fit.fit import fit, stated_u
from analysis.fit.problem import Problem
from analysis.models import MODELS
from instrument.config.load import Loaded
from instrument.geometry import FloatArray, Geometry
from instrument.pinhole import Pinhole
from instrument.record.record import Record

NAMES = ("sigma_deg", "albedo")
_OWN, _PHOTONS, _STATED = "demonstration", "photons", "u_stated_relative"
_WORDS = {"sigma_deg": "roughness σ", "albedo": "albedo"}


@dataclass(frozen=True, slots=True)
class Settings:
    """View angles of an incidence, frames of a point, exposure as a part of full scale."""

    views: int = 33
    frames: int = 4
    exposure_target: float = 0.7


DEFAULT = Settings()
VIEWS: tuple[int, ...] = (9, 17, 65, 129)
FRAMES: tuple[int, ...] = (1, 2, 8, 16)
TARGETS: tuple[float, ...] = (0.05, 0.2, 0.4)
_QUICK = VIEWS[1:2], FRAMES[:1], TARGETS[:1]


@dataclass(frozen=True, slots=True)
class Found:
    """Errors of the parameters relative to the truth (seeds, NAMES), and the relative u stated."""

    errors: FloatArray
    stated: FloatArray


def variants(thorough: bool) -> list[tuple[str, str, Settings]]:
    """Series, label and settings: the demonstration, and one setting changed at a time."""
    views, frames, targets = (VIEWS, FRAMES, TARGETS) if thorough else _QUICK
    found = [(_OWN, _OWN, DEFAULT)]
    found += [("step", f"step {160 / (n - 1):g}°", replace(DEFAULT, views=n)) for n in views]
    found += [("frames", f"{n} frame{'s' * (n > 1)}", replace(DEFAULT, frames=n)) for n in frames]
    found += [
        ("exposure", f"exposed to {t:.0%}", replace(DEFAULT, exposure_target=t)) for t in targets
    ]
    return found


def scan_study(effort: Effort) -> Study:
    """All settings, each with as many seeds."""
    trials: list[Trial] = []
    with TemporaryDirectory(prefix="gonio-bench-") as folder:
        for series, label, settings in variants(effort.thorough):
            found = simulated(settings, effort.seeds, Path(folder) / label)
            trials += _trials(series, label, settings, found)
    return Study(
        "scan",
        "Scan: what more angles, frames and light bring",
        "time on the bench (minutes)",
        "relative error, rms over scans",
        _caption(trials),
        f"the simulated sample’s own parameters, {effort.seeds} scans of each setting (an rms "
        f"good to {percent(1 / math.sqrt(2 * effort.seeds))}), pixels binned {BINNING} × "
        f"{BINNING}; limits after Cramér and Rao",
        tuple(trials),
        error_is="rms",
    )


def _caption(trials: Sequence[Trial]) -> str:
    own = {t.scene: t for t in trials if t.default}
    limit = {t.scene: t.error for t in trials if t.bound and t.label == f"{_PHOTONS}: {_OWN}"}
    stated = {scene: t.more[_STATED] for scene, t in own.items()}
    reached = ", ".join(
        f"{percent(u)} for the {scene} ({rounded(u / limit[scene])} times what photons allow)"
        for scene, u in stated.items()
    )
    rough = _ends([t for t in trials if t.scene == _WORDS["sigma_deg"] and not t.bound])
    words = ", ".join(
        f"{t.label} {rounded(t.more[_STATED] / stated[t.scene])} times in {rounded(t.cost)} min"
        for t in rough
    )
    albedo = [t for t in trials if t.scene == _WORDS["albedo"] and not t.bound and not t.default]
    ratios = [t.more[_STATED] / stated[t.scene] for t in albedo]
    change = f"{rounded(min(ratios))} to {rounded(max(ratios))}"
    minutes = next(iter(own.values())).cost
    return (
        f"The demonstration states {reached}, in {rounded(minutes)} minutes. The albedo’s u is "
        f"shared by all points (tile, lamp, placing): other settings make it {change} times as "
        f"large.\nThe roughness has, against that, a stated u of: {words}."
    )


def _ends(trials: Sequence[Trial]) -> list[Trial]:
    """Of each series the cheapest and the dearest, without the default."""
    others = [t for t in trials if not t.default]
    ends: list[Trial] = []
    for series in dict.fromkeys(t.series for t in others):
        own = [t for t in others if t.series == series]
        found = (min(own, key=lambda t: t.cost), max(own, key=lambda t: t.cost))
        ends += [t for t in own if t in found]
    return ends


def simulated(settings: Settings, seeds: int, folder: Path) -> Found:
    """Scan, reduce and fit with the sample's own model, once for each seed."""
    errors, stated = [], []
    for seed in range(1, seeds + 1):
        loaded = demonstration(**asdict(settings), seed=seed)
        values, u = _once(loaded, folder / str(seed))
        truth = _truth(loaded)
        errors.append([values[name] / truth[name] - 1 for name in NAMES])
        stated.append([u[name] / truth[name] for name in NAMES])
    return Found(np.array(errors), np.array(stated))


def _truth(loaded: Loaded) -> dict[str, float]:
    sample = loaded.protocol.simulated_sample
    if sample is None:
        raise ValueError("the demonstration has no simulated sample; allowed: one with parameters")
    return sample.parameters


def _once(loaded: Loaded, folder: Path) -> tuple[dict[str, float], dict[str, float]]:
    """Parameters and their u from one simulated scan by the program's own engine."""
    sample = loaded.protocol.simulated_sample
    model = MODELS[sample.model if sample is not None else ""]
    devices = open_devices(loaded)
    try:
        with Record.create(folder, {}) as record:
            engine = Engine(loaded.protocol, loaded.rig, devices, record, _nothing)
            engine.run(make_plan(loaded))
            reduced = reduced_run(record, loaded)
    finally:
        devices.close()
    points = measurements(reduced, loaded)
    found = fit(model, points, Acceptance.of(loaded.rig, loaded.protocol.window))
    return dict(found.values), stated_u(found, points)


def _nothing(step: Step) -> None:
    """What is told of every step, and needs no word here."""


def photon_limit(loaded: Loaded, plan: Plan) -> dict[str, float]:
    """Least u of the parameters that photon and read noise allow, by Cramer and Rao.

    The inverse of the Fisher information J^T C^-1 J, J the model's derivatives, C the variance of
    the electrons that the plan's exposures collect in the window.
    """
    sample = loaded.protocol.simulated_sample
    model, truth = MODELS[sample.model if sample is not None else ""], _truth(loaded)
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
    """Relative noise of every point from the electrons in its window."""
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


def _trials(series: str, label: str, settings: Settings, found: Found) -> list[Trial]:
    loaded = demonstration(**asdict(settings))
    plan = make_plan(loaded)
    minutes, truth, limit = plan.duration_s / 60, _truth(loaded), photon_limit(loaded, plan)
    trials: list[Trial] = []
    for column, name in enumerate(NAMES):
        errors, stated = found.errors[:, column], float(np.median(found.stated[:, column]))
        scene = _WORDS[name]
        more = {
            "bias_relative": float(errors.mean()),
            "u_bias_relative": float(errors.std(ddof=1) / math.sqrt(errors.size)),
            _STATED: stated,
            "geometries": float(len(plan.points)),
        }
        trials.append(
            Trial(
                "scan", scene, series, label, minutes,
                float(np.sqrt(np.mean(errors**2))), float(np.median(np.abs(errors))),
                default=settings == DEFAULT, more=more,
            )
        )  # fmt: skip
        for what, value in ((_PHOTONS, limit[name] / truth[name]), ("all parts of u", stated)):
            trials.append(
                Trial(
                    "scan", scene, f"limit: {what}", f"{what}: {label}", minutes, value, value,
                    bound=True,
                )
            )  # fmt: skip
    return trials
