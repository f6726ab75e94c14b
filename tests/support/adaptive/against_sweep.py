"""An adaptive scan and the even sweep of 5 degrees on the same bench, for the same u of sigma."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.adaptive.aims import Aims
from acquisition.adaptive.candidate_list import candidate_list, with_goal
from acquisition.adaptive.chooser import Chooser
from acquisition.adaptive.layout import Layout
from acquisition.plan.plan import Step, make_plan
from acquisition.results.fitting import measurements
from acquisition.results.reduction import reduced_rows
from analysis.choice.choice import Choice, choose
from analysis.choice.ladder import physics
from instrument.config.load import Loaded
from instrument.config.protocol import Steps
from instrument.geometry import Brdf
from instrument.record.reading import Rows, batches_of
from tests.support.adaptive.predicted_bench import PredictedBench
from tests.support.random_plans import base
from tests.support.scans import changed

Sample = tuple[str, dict[str, float]]

PAPER: dict[
    str, Sample
] = {  # Oren and Nayar 1995, table 1; sigma in degrees, ks of ours is 4 times
    "A": ("oren_nayar", {"albedo": 0.90, "sigma_deg": 35.0}),
    "C": ("oren_nayar", {"albedo": 0.70, "sigma_deg": 40.0}),
    "D": ("oren_nayar+torrance_sparrow", {"albedo": 0.80, "sigma_deg": 20.0, "ks": 0.076}),
    "E": ("oren_nayar+torrance_sparrow", {"albedo": 0.73, "sigma_deg": 24.0, "ks": 0.135}),
    "F": ("oren_nayar+torrance_sparrow", {"albedo": 0.88, "sigma_deg": 17.0, "ks": 0.117}),
}


def random_sample(seed: int) -> Sample:
    """A sample with a roughness of its own, of random model and parameters."""
    rng = np.random.default_rng([seed, 21])
    own = {"albedo": rng.uniform(0.1, 0.95), "sigma_deg": rng.uniform(8, 40)}
    kinds: list[tuple[str, dict[str, float]]] = [
        ("oren_nayar", {}),
        ("oren_nayar+torrance_sparrow", {"ks": rng.uniform(0.02, 0.15)}),
        ("oren_nayar+ggx", {"f0": rng.uniform(0.02, 0.08), "alpha": rng.uniform(0.1, 0.5)}),
        ("wolff_oren_nayar", {"n": rng.uniform(1.3, 1.7)}),
    ]
    name, more = kinds[int(rng.integers(len(kinds)))]
    return name, {**own, **more}


class NoSweepU(ValueError):
    """The sweep's fit states no u that an adaptive scan could be asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scanned:
    """Result of a scan: time of its points in s, u of sigma and deviation in units of it."""

    points: int
    seconds: float
    model: str
    verdict: str
    u: float | None
    deviation: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """The sweep and the adaptive scan of one sample; `end`: why the latter ended."""

    sample: Sample
    sweep: Scanned
    adaptive: Scanned
    end: str

    @property
    def ratio(self) -> float:
        """Bench time of the adaptive scan over that of the sweep."""
        return self.adaptive.seconds / self.sweep.seconds


def summary(found: Sequence[Compared]) -> dict[str, float]:
    """Figures of a study: ratios of time, points, models that were right, intervals that hold."""
    ratios = [one.ratio for one in found]
    kinds = {"adaptive": [one.adaptive for one in found], "sweep": [one.sweep for one in found]}
    figures = {
        "samples": len(found),
        "median ratio": float(np.median(ratios)),
        "largest ratio": max(ratios),
        "median points": float(np.median([one.adaptive.points for one in found])),
        "goal reached": sum(one.end.startswith("the goal is reached") for one in found),
    }
    for name, scans in kinds.items():
        off = [scan.deviation for scan in scans if scan.deviation is not None]
        figures[f"right model, {name}"] = len(off)
        figures[f"within 1.96 u, {name}"] = sum(abs(one) < 1.96 for one in off)
    return figures


def five_degrees() -> Loaded:
    """The demonstration: three incidences, 33 views from -80 to 80 degrees."""
    return changed(base("bench_12bit"))


def ten_degrees(plain: Loaded) -> Loaded:
    """Copy whose sweep has each second view."""
    (sweep,) = plain.protocol.sweeps
    return changed(plain, sweeps=[{**sweep, "theta_r_deg": Steps(start=-80.0, stop=80.0, num=17)}])


def quick_fit(rows: Rows, loaded: Loaded) -> Choice:
    """Fit as the run does, without the rig's acceptance: predicted readings have none."""
    m = measurements(reduced_rows(rows, loaded), loaded)
    return choose(m, None, loaded.protocol.fit.models, method="functional")


def in_dim_light() -> Loaded:
    """The same with a lamp so dim that exposures are long, 8 bits, and a patch of 4 mm.

    As with a narrow filter before the lamp: the time of a point is that of its frames, and noise
    is most of its u.
    """
    bright = five_degrees()
    camera = bright.rig.camera.model_copy(update={"bit_depth": 8})
    lamp = bright.rig.lamp.model_copy(update={"white_electrons_per_s": 4000.0})
    patch = bright.protocol.window.model_copy(update={"width_mm": 4.0, "height_mm": 4.0})
    return changed(bright, rig={"camera": camera, "lamp": lamp}, window=patch)


def compared(
    sample: Sample,
    seed: int,
    folder: Path,
    times: float = 1.0,
    plain: Loaded | None = None,
    extra: Brdf | None = None,
) -> Compared:
    """Measure a sample in both ways, with the same errors of the bench.

    The goal is so many `times` the u of sigma that the sweep's fit states; without one, of the
    albedo. plain: the sweep's protocol and rig, those of the demonstration if not given. extra:
    what the sample's BRDF has beyond its model, in 1/sr. Raises `NoSweepU`.
    """
    plain = five_degrees() if plain is None else plain
    sweep, name, wanted = _swept(plain, sample, seed, extra)
    listed = candidate_list(with_goal(plain, f"{name}={times * wanted!r}", None))
    bench = PredictedBench(listed, seed, sample, extra=extra)
    with bench.create(folder) as record:
        known = bench.run(record).known
        end = batches_of(record.events())[-1].end
        choice = quick_fit(record.rows(), listed)
    adaptive = _scanned(choice, known, bench.chooser.layout, sample, name)
    return Compared(sample=sample, sweep=sweep, adaptive=adaptive, end=end)


def _swept(
    plain: Loaded, sample: Sample, seed: int, extra: Brdf | None
) -> tuple[Scanned, str, float]:
    plan = make_plan(plain)
    chooser = Chooser(Layout(plan, plain), Aims(u={}, budget_s=None, models=None, method="auto"))
    bench = PredictedBench(plain, seed, sample, chooser, extra)
    choice = quick_fit(Rows(bench.all_readings(), (), ()), plain)
    best = choice.best
    if best is None:
        raise NoSweepU("the sweep has no fit")
    name = "sigma_deg" if best.u.get("sigma_deg") is not None else "albedo"
    u = best.u.get(name)
    if u is None:
        raise NoSweepU(f"the sweep states no u of {name}")
    return _scanned(choice, plan.steps, chooser.layout, sample, name), name, u


def _scanned(
    choice: Choice, steps: Sequence[Step], layout: Layout, sample: Sample, name: str
) -> Scanned:
    best, truth = choice.best, sample[1]
    u = None if best is None else best.u.get(name)
    off = None
    if best is not None and u is not None and physics(best.model) == physics(sample[0]):
        off = (best.values[name] - truth[name]) / u
    return Scanned(
        points=sum(step.kind == "point" for step in steps),
        seconds=points_s(steps, layout),
        model="" if best is None else best.model,
        verdict=choice.verdict,
        u=u,
        deviation=off,
    )


def points_s(steps: Sequence[Step], layout: Layout) -> float:
    """Time of the points alone: their moves, their settling and their frames."""
    before = [None, *steps[:-1]]
    return sum(
        layout.frames_s(step) + (0.0 if last is None else layout.moves_s(last.pose, step.pose))
        for last, step in zip(before, steps, strict=True)
        if step.kind == "point"
    )
