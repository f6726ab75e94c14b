"""u of the parameters that a plan will give, by the way that the values of a run take.

Predicted readings are reduced as those of a run are, so that every error of the budget is there,
shared as it is. The rig's finite lamp, lens and patch are left out: they change all designs alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from acquisition.design.assumed_sample import AssumedSample
from acquisition.design.predicted_readings import PredictedReadings
from acquisition.plan.plan import Plan
from acquisition.results.fitting import measurements
from acquisition.results.reduction import NOISE, reduced_rows
from analysis.data.covariance import ANGLES, LAMP_LEVEL
from analysis.data.measurements import Measurements
from analysis.design.information import Information, assumed_problem
from analysis.fit.relative_scale import unscaled_parameters
from analysis.fit.search.problem import Problem
from instrument.config.load import Loaded
from instrument.errors import InputError
from instrument.geometry import BoolArray, FloatArray, Geometry
from instrument.record.reading import Rows

INDEPENDENT = "noise"
"""Source of what no two points share: noise, rounding, texture."""

UNDETERMINED = 0.25
"""Part of a parameter's domain; a u beyond it says nothing."""


@dataclass(frozen=True, kw_only=True)
class Forecast:
    """Planned points (N,) as a fit will take them, for an assumed sample.

    used: mask over the plan's points of those that the fit will use. averaged: (N,), part of each
    one's independent variance that frames average, 0 to 1. problem: the assumed model's, at x (K,),
    its parameters.
    """

    used: BoolArray
    averaged: FloatArray
    measurements: Measurements
    problem: Problem
    x: FloatArray

    @cached_property
    def information(self) -> Information:
        """Information of the points about the parameters."""
        return Information.of(self.problem, self.x)

    @cached_property
    def _shared_parts(self) -> FloatArray:
        return self.information.shared_parts(np.ones(self.measurements.size))

    def u(self) -> dict[str, float]:
        """Standard uncertainty of each parameter, in its unit, by all points measured once.

        Without those that relative values do not determine.
        """
        m = self.measurements
        lost = unscaled_parameters(self.problem.model) if m.relative else frozenset[str]()
        found = self.information.u(np.ones(m.size))
        return {name: u for name, u in found.items() if name not in lost}

    def sources(self, parameter: str) -> dict[str, float]:
        """Parts of a parameter's variance by the source of error, of a sum of 1, largest first."""
        m, information = self.measurements, self.information
        shared = self._shared_parts[information.names.index(parameter)]
        found = {INDEPENDENT: float(1 - shared.sum())}
        named = sorted({error.name for error in m.shared}, key=len, reverse=True)
        for numbered, part in zip(information.errors, shared.tolist(), strict=True):
            source = next((name for name in named if numbered.startswith(name)), None)
            source = source or (LAMP_LEVEL if numbered.startswith(LAMP_LEVEL) else ANGLES)
            found[source] = found.get(source, 0.0) + part
        return dict(sorted(found.items(), key=lambda item: -item[1]))


class Forecaster:
    """Forecasts of one plan for any samples."""

    def __init__(self, loaded: Loaded, plan: Plan) -> None:
        self._loaded = _without_patch(loaded)
        self._readings = PredictedReadings(self._loaded, plan)

    def of(self, sample: AssumedSample) -> Forecast:
        """Forecast the plan for a sample. Raises `InputError` if no point can be used."""
        values = dict(
            zip((p.name for p in sample.model.parameters), sample.x.tolist(), strict=True)
        )

        def brdf(geometry: Geometry) -> FloatArray:
            return sample.model.brdf(geometry, **values)

        reduced = reduced_rows(Rows(self._readings.of(brdf), (), ()), self._loaded)
        if not np.any(reduced.valid):
            flags = ", ".join(sorted({flag for flag in reduced.flags if flag}))
            raise InputError(
                f"{self._loaded.protocol_path}: none of its geometries can be used for a sample "
                f"like {sample.text}: {flags}"
            )
        m = measurements(reduced, self._loaded)
        problem, x = assumed_problem(sample.model, sample.x, m)
        noise = reduced.components[NOISE][reduced.valid] * problem.brdf
        return Forecast(
            used=reduced.valid,
            averaged=np.square(noise / problem.covariance.u_independent),
            measurements=m,
            problem=problem,
            x=x,
        )


def forecast(loaded: Loaded, plan: Plan, sample: AssumedSample) -> Forecast:
    """Forecast a plan for a sample. Raises `InputError` if none of its points can be used."""
    return Forecaster(loaded, plan).of(sample)


def _without_patch(loaded: Loaded) -> Loaded:
    """Return a rig without a dark patch: what it will show of stray light is not known before."""
    if loaded.rig.camera.dark_patch is None:
        return loaded
    camera = loaded.rig.camera.model_copy(update={"dark_patch": None})
    return replace(loaded, rig=loaded.rig.model_copy(update={"camera": camera}))


def asked_parameters(
    text: str | None, sample: AssumedSample, loaded: Loaded, option: str = "--for"
) -> list[str]:
    """Return the parameters named in an option, separated by commas; without it, all that can be.

    Raises `InputError` for one that the model does not have, or that a scan without a white tile
    does not determine.
    """
    names = [p.name for p in sample.model.parameters]
    absolute = loaded.protocol.references.white_tile is not None
    lost = frozenset[str]() if absolute else unscaled_parameters(sample.model)
    allowed = [name for name in names if name not in lost]
    if not allowed:
        raise InputError(
            f"{loaded.protocol_path}: without a white tile the scan determines no parameter of "
            f"{sample.model.name}; allowed: a protocol with references: white_tile"
        )
    if text is None:
        return allowed
    asked = list(dict.fromkeys(filter(None, (part.strip() for part in text.split(",")))))
    for name in asked:
        if name in lost:
            raise InputError(
                f"{option} {name}: not determined without a white tile; allowed: "
                f"{', '.join(allowed)}"
            )
    wrong = [name for name in asked if name not in names]
    if wrong or not asked:
        what = ", ".join(wrong) or "nothing"
        raise InputError(
            f"{option}: {sample.model.name} has no parameter {what}; allowed: {', '.join(allowed)}"
        )
    return asked
