"""Scans without pictures: readings as predicted for a sample, with drawn errors of every kind.

They have each error of the budget as large as it is stated, and shared as it is, so that a whole
scan takes a hundredth of a second. The engine's part is small: it measures what a plan knows, and
asks for more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from acquisition.adaptive.candidate_list import candidate_list, with_goal
from acquisition.adaptive.chooser import Chooser
from acquisition.adaptive.course import chooser_of, chosen_while_measured
from acquisition.design.predicted_readings import PredictedReadings
from acquisition.measure.placement import tilt_deg
from acquisition.plan.plan import Plan, Step, make_plan
from acquisition.results.run_folder import run_meta
from analysis.models import MODELS
from instrument.config.load import Loaded
from instrument.config.protocol import FitConfig
from instrument.geometry import Brdf, FloatArray, Geometry
from instrument.record.reading import Reading
from instrument.record.record import Record
from tests.support.random_plans import base
from tests.support.scans import TWO_MODELS, changed

SAMPLE = ("oren_nayar+torrance_sparrow", {"albedo": 0.8, "sigma_deg": 20.0, "ks": 0.076})
"""The demonstration's: sample D of the 1995 paper."""


def adaptive_scan(
    until: str,
    budget_min: float | None = None,
    *,
    rig: str = "bench_12bit",
    models: str | None = TWO_MODELS,
    views: int = 17,
    incidences: tuple[float, ...] = (30.0, 60.0),
    **protocol: object,
) -> Loaded:
    """List of candidates of the demonstration with so many views at each incidence."""
    sweep = {
        "theta_i_deg": list(incidences),
        "dphi_deg": [0.0],
        "theta_r_deg": np.linspace(-80, 80, views).tolist(),
    }
    fit = FitConfig(models=None if models is None else models.split(", "))
    loaded = changed(base(rig), sweeps=[sweep], fit=fit, **protocol)
    return candidate_list(with_goal(loaded, until, budget_min))


class PredictedBench:
    """Bench that measures the steps of a list of candidates; `seed`: of all its errors.

    extra: what the sample's BRDF has beyond its model, in 1/sr.
    """

    def __init__(
        self,
        loaded: Loaded,
        seed: int = 0,
        sample: tuple[str, Mapping[str, float]] = SAMPLE,
        chooser: Chooser | None = None,
        extra: Brdf | None = None,
    ) -> None:
        self.loaded, self._seed = loaded, seed
        self.plan = make_plan(loaded)
        self.chooser = chooser or chooser_of(loaded, self.plan)
        self._extra = extra
        self._model, self._parameters = MODELS[sample[0]], dict(sample[1])
        self._predicted = PredictedReadings(loaded, self.plan).of(self._brdf)

    def create(self, folder: Path) -> Record:
        """Create the record of a run, as `gonio run` does."""
        return Record.create(folder, run_meta(self.loaded, self.plan))

    def run(self, record: Record, upto: int | None = None) -> Plan:
        """Measure, or go on with, a run; end as if killed once the record has `upto` readings."""
        plan = chosen_while_measured(self.chooser, record)
        done = {reading.step for reading in record.readings()}
        steps = [step for step in plan.known if step.index not in done]
        while steps or plan.growing:
            for step in steps:
                if len(record.readings()) == upto:
                    return plan
                record.add_reading(self.reading(step, record))
            steps = list(plan.more())
        record.set_meta("steps", str(len(plan.known)))
        return plan

    def all_readings(self) -> list[Reading]:
        """Return the readings of all steps, in the order of the list."""
        times = [step.start_s + step.duration_s for step in self.plan.steps]
        return [
            replace(self._drawn(r, r.frames), time_s=t, free_s=t)
            for r, t in zip(self._predicted, times, strict=True)
        ]

    def reading(self, step: Step, record: Record) -> Reading:
        """Return the reading of a step, at the time when the scan comes to it."""
        made = max(record.readings(), key=lambda r: r.time_s, default=None)
        begun_s, before = (0.0, []) if made is None else (made.free_s, [self.plan.steps[made.step]])
        end_s = begun_s + self.chooser.layout.seconds([step], before)
        drawn = self._drawn(self._predicted[step.index], step.frames)
        return replace(drawn, time_s=end_s, free_s=end_s)

    def _brdf(self, geometry: Geometry) -> FloatArray:
        own = self._model.brdf(geometry, **self._parameters)
        return np.asarray(own if self._extra is None else own + self._extra(geometry))

    def _random(self, *key: object) -> float:
        """Return a draw of a standard normal distribution for a key, the same each time."""
        words = [self._seed, *repr(key).encode()]
        return float(np.random.default_rng(words).standard_normal())

    def _drawn(self, r: Reading, frames: int) -> Reading:
        u_noise_dn = r.u_noise_dn * np.sqrt(r.frames / frames)
        r = replace(r, frames=frames, u_noise_dn=float(u_noise_dn))
        # Rounding and texture are the same each time at one geometry: at checks of the drift, too.
        at = (r.surface, r.theta_i_deg, r.theta_r_deg, r.dphi_deg)
        placed = r.u_placement_dn * self._random("placement", r.surface)
        factor = 1 + (placed + r.u_texture_dn * self._random("texture", *at)) / r.signal_dn
        factor *= self._by_angles(r) * self._by_tile(r)
        signal = r.signal_dn * factor + r.u_noise_dn * self._random("noise", r.step)
        signal += r.u_quantisation_dn * self._random("rounding", *at)
        signal += r.u_dark_dn * self._random("dark", r.exposure_s)
        return replace(  # the errors of place are relative ones, as those found in a picture
            r,
            signal_dn=float(signal),
            u_placement_dn=float(r.u_placement_dn * factor),
            u_texture_dn=float(r.u_texture_dn * abs(factor)),
        )

    def _by_angles(self, r: Reading) -> float:
        """Factor on a reading by the errors of its angles."""
        axes = self.loaded.rig.axes
        off_i = axes.theta_i.u_deg * self._random("theta_i", r.theta_i_deg)
        off_r = axes.theta_r.u_deg * self._random("theta_r", r.theta_r_deg)
        lit = np.cos(np.radians(r.theta_i_deg + off_i)) / np.cos(np.radians(r.theta_i_deg))
        if r.surface != "sample":
            return float(lit)
        by_i, by_r = self._tilts_deg(r)
        there, here = (
            self._brdf(Geometry.from_degrees(theta_i=i, theta_r=t, dphi=r.dphi_deg))
            for i, t in (
                (r.theta_i_deg + off_i + by_i, r.theta_r_deg + off_r + by_r),
                (r.theta_i_deg, r.theta_r_deg),
            )
        )
        return float(lit * there / here)

    def _tilts_deg(self, r: Reading) -> FloatArray:
        """Changes (2,) of theta_i and theta_r, in degrees, by a sample that is off the axes."""
        rig, placed = self.loaded.rig, self._random("placement", r.surface)
        angles = np.array([r.theta_i_deg, r.theta_r_deg])
        distances = np.array([rig.lamp_distance_mm, rig.beam_length_mm])
        return placed * tilt_deg(angles, rig.u_placement_mm, 1.0) / distances

    def _by_tile(self, r: Reading) -> float:
        tile = self.loaded.protocol.references.white_tile
        if r.kind != "tile" or tile is None or tile.reflectance is None:
            return 1.0
        return 1 + (tile.u_reflectance or 0.0) / tile.reflectance * self._random("certificate")
