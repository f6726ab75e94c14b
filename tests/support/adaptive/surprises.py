"""Samples with something that no candidate model has: a retro peak, a narrow lobe, a broad bump."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from acquisition.adaptive.aims import Aims
from acquisition.adaptive.candidate_list import candidate_list, with_goal
from acquisition.adaptive.chooser import Chooser
from acquisition.adaptive.layout import Layout
from acquisition.plan.plan import make_plan
from instrument.config.load import Loaded
from instrument.config.protocol import FitConfig
from instrument.geometry import Brdf, FloatArray, Geometry
from instrument.record.reading import Rows
from tests.support.adaptive.against_sweep import quick_fit
from tests.support.adaptive.predicted_bench import SAMPLE, PredictedBench
from tests.support.scans import TWO_MODELS, changed

UNTIL = "sigma_deg=0.02"

Kind = Literal["retro peak", "narrow lobe", "other family"]
KINDS: tuple[Kind, ...] = ("retro peak", "narrow lobe", "other family")


def surprise(kind: Kind, seed: int) -> Brdf:
    """Random addition to a BRDF, in 1/sr, in the plane of incidence.

    retro peak: towards the lamp, 3 to 6 degrees wide (1 sigma). narrow lobe: up to 5 degrees off
    the mirror direction, 0.7 to 1.5 degrees wide. other family: a bump of 5 to 10 % of a white
    sample, 20 to 30 degrees wide, that turns with the lamp half as far.
    """
    rng = np.random.default_rng([seed, len(kind)])
    height, width, off = {
        "retro peak": (rng.uniform(0.02, 0.1), rng.uniform(3, 6), 0.0),
        "narrow lobe": (rng.uniform(0.1, 0.5), rng.uniform(0.7, 1.5), rng.uniform(-5, 5)),
        "other family": (rng.uniform(0.05, 0.1) / np.pi, rng.uniform(20, 30), rng.uniform(-30, 30)),
    }[kind]
    turned = {"retro peak": 1.0, "narrow lobe": -1.0, "other family": 0.5}[kind]

    def brdf(geometry: Geometry) -> FloatArray:
        signed = np.where(geometry.dphi_deg < 90, geometry.theta_r_deg, -geometry.theta_r_deg)
        away = signed - turned * geometry.theta_i_deg - off
        return np.asarray(height * np.exp(-np.square(away / width) / 2))

    return brdf


def found(kind: Kind, seed: int, folder: Path, plain: Loaded) -> tuple[bool, bool, float]:
    """Say whether the sweep and an adaptive scan found that no candidate model holds.

    And the points of the adaptive scan as a part of the sweep's. The sample is the demonstration's
    with the surprise; u of sigma to reach: `UNTIL`, in the bench time of the sweep. plain: the
    sweep's protocol and rig.
    """
    plain = changed(plain, fit=FitConfig(models=TWO_MODELS.split(", ")))
    plan, extra = make_plan(plain), surprise(kind, seed)
    chooser = Chooser(Layout(plan, plain), Aims(u={}, budget_s=None, models=None, method="auto"))
    swept = PredictedBench(plain, seed, SAMPLE, chooser, extra).all_readings()
    listed = candidate_list(with_goal(plain, UNTIL, plan.duration_s / 60))
    bench = PredictedBench(listed, seed, SAMPLE, extra=extra)
    with bench.create(folder) as record:
        bench.run(record)
        chosen = record.rows()
    choices = [quick_fit(rows, plain) for rows in (Rows(swept, (), ()), chosen)]
    by_sweep, adaptive = (choice.verdict == "none adequate" for choice in choices)
    points = sum(reading.kind == "point" for reading in chosen.readings)
    return by_sweep, adaptive, points / len(plan.points)
