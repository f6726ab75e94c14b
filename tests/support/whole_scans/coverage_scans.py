"""Simulated scans with drawn errors, and their deviations from the truth in units of the stated u.

The draws: noise, angle errors, mottling, height of each placement, lamp drift, and the part of a
count by which the black level differs from a whole number. Of the errors that a scan has only once
or a few times, the scans of a series have each one part of the distribution (a Latin hypercube):
drawn freely, their mean square over 40 scans is off by a fifth, and with it all deviations.
"""

from __future__ import annotations

import gc
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import NormalDist

import numpy as np

from acquisition.engine.engine import Devices
from acquisition.measure.window import window_at
from acquisition.results.fitting import measurements
from acquisition.results.reduction import reduce
from analysis.data.acceptance import Acceptance, averaged_brdf
from analysis.data.covariance import full_covariance
from analysis.data.measurements import Measurements
from analysis.fit.fit import fit
from analysis.models import MODELS
from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import DriftCheck, References, WhiteTile
from instrument.config.simulated.sample import SimulatedSample
from instrument.devices import Request
from instrument.geometry import FloatArray, Geometry
from instrument.pinhole import Pinhole
from instrument.record.record import Record
from sim.scene.operator import SimulatedOperator
from sim.scene.render import electrons_per_s
from tests.support.paths import CONFIGS
from tests.support.scans import changed, exact_rig, shrunk, simulated_scene
from tests.support.whole_scans.stopped_scan import scan

BANDS_DEG = ((0.0, 30.0), (30.0, 60.0), (60.0, 75.0), (75.0, 85.0))
_RINGS = 4  # of the truth's average over lamp and lens
_ERRORS = 6  # black level, lamp drift, and the heights of up to four placements


@dataclass(frozen=True, slots=True)
class Deviations:
    """Deviations of one scan: of points (N,) at theta_r_deg (N,), and of fitted parameters.

    In units of the stated u; a parameter without u is left out. relative: of the points, (N,).
    """

    theta_r_deg: FloatArray
    points: FloatArray
    relative: FloatArray
    parameters: dict[str, float]


@dataclass(frozen=True, slots=True)
class Drawn:
    """A scan with drawn errors. heights_mm: of its placements, one after the other."""

    loaded: Loaded
    heights_mm: tuple[float, ...]


class PlacingOperator:
    """Simulated operator who places each surface at the next of some heights, in mm."""

    def __init__(self, operator: SimulatedOperator, heights_mm: tuple[float, ...]) -> None:
        self._operator, self._heights_mm = operator, iter(heights_mm)

    def ask(self, request: Request) -> str:
        """Carry out a request; a placing sets the height."""
        if request.action == "place":
            self._operator._scene.heights_mm[request.surface] = next(self._heights_mm)
        return self._operator.ask(request)


def _parts(series: int) -> FloatArray:
    """Places of the scans in their distributions, (_ERRORS, series), each from 0 to 1."""
    random = np.random.default_rng([series, 2])
    return np.array([random.permutation(series) + 0.5 for _ in range(_ERRORS)]) / series


def drawn_scan(
    rig: str,
    sample: SimulatedSample,
    number: int,
    series: int,
    bits: int | None = None,
    shrink: int = 1,
) -> Drawn:
    """Scan `number` of a series, which is its seed: two incidences and 19 view angles.

    The tile is known exactly. shrink: rows and columns of the camera are divided by it.
    """
    path = CONFIGS / "rigs" / f"{rig}.yaml"
    demo = shrunk(load_protocol(CONFIGS / "protocols" / "demo.yaml", path), shrink)
    part = _parts(series)[:, number]
    normal = [NormalDist().inv_cdf(p) for p in part]
    camera = demo.rig.camera
    camera = camera.model_copy(
        update={
            "bit_depth": bits or camera.bit_depth,
            "black_level_dn": camera.black_level_dn + part[0] - 0.5,
        }
    )
    simulation = demo.rig.simulation.model_copy(
        update={"seed": number, "lamp_drift_per_hour": 0.02 * normal[1]}
    )
    sweep = {
        "theta_i_deg": [30.0, 60.0],
        "dphi_deg": [0.0],
        "theta_r_deg": [*np.arange(-80.0, 0.0, 10.0), -5.0, 0.0, 5.0, *np.arange(10.0, 81.0, 10.0)],
    }
    tile = WhiteTile(reflectance=0.99, u_reflectance=0.0, theta_r_deg=10.0)
    references = References(
        white_tile=tile, drift_check=DriftCheck(theta_r_deg=10.0, every_points=10)
    )
    loaded = changed(
        demo,
        rig={"camera": camera, "simulation": simulation},
        sweeps=[sweep],
        references=references,
        simulated_sample=sample,
    )
    return Drawn(loaded, tuple(demo.rig.u_placement_mm * x for x in normal[2:]))


def _mean_sample(m: Measurements, loaded: Loaded) -> Measurements:
    """Measurements divided by the mean of the mottling over the patch: the sample is its model."""
    rig, patch = exact_rig(loaded.rig), loaded.protocol.window
    window = window_at(0.0, Pinhole.of(rig), patch.width_mm, patch.height_mm)
    plain = loaded.protocol.simulated_sample.model_copy(update={"mottling": 0.0})
    levels = []
    for sample in (loaded.protocol.simulated_sample, plain):
        scene = simulated_scene(changed(replace(loaded, rig=rig), simulated_sample=sample))
        levels.append(window.mean(electrons_per_s(scene)[window.crop].astype(np.float64)))
    factor = levels[0] / levels[1]
    return replace(m, brdf=m.brdf / factor, u_random=m.u_random / factor)


def measured(drawn: Drawn, folder: Path) -> Measurements:
    """Run a scan with drawn placements, and return its measurements as the fit takes them."""
    loaded = drawn.loaded

    def placing(devices: Devices) -> Devices:
        assert isinstance(devices.operator, SimulatedOperator)
        return replace(devices, operator=PlacingOperator(devices.operator, drawn.heights_mm))

    with Record.create(folder, {}) as record:
        scan(loaded, record, changed_devices=placing)
        m = measurements(reduce(record.readings(), loaded.protocol, ()), loaded)
    gc.collect()  # an engine and its frames are few objects, in a circle: seldom looked for
    return _mean_sample(m, loaded)


def deviations(m: Measurements, loaded: Loaded) -> Deviations:
    """Compare measured values, and the fit of the true model to them, with the truth."""
    sample = loaded.protocol.simulated_sample
    assert sample is not None

    def true_model(geometry: Geometry) -> FloatArray:
        return MODELS[sample.model].brdf(geometry, **sample.parameters)

    acceptance = Acceptance.of(loaded.rig, loaded.protocol.window)
    angles = (m.theta_i_deg, m.theta_r_deg, m.dphi_deg)
    truth = averaged_brdf(true_model, *angles, acceptance, _RINGS)
    fitted = fit(MODELS[sample.model], m, acceptance)
    return Deviations(
        m.theta_r_deg,
        (m.brdf - truth) / full_covariance(m, true_model).u_total,
        m.brdf / truth - 1,
        {
            name: (fitted.values[name] - sample.parameters[name]) / u
            for name, u in fitted.u.items()
            if u is not None
        },
    )


def by_band(found: list[Deviations]) -> dict[str, FloatArray]:
    """Deviations of all points of each band of view angle, in u, by the band's name."""
    theta_r = np.abs(np.concatenate([one.theta_r_deg for one in found]))
    points = np.concatenate([one.points for one in found])
    return {
        f"{low:g} to {high:g} deg": points[(low <= theta_r) & (theta_r < high)]
        for low, high in BANDS_DEG
    }


def by_parameter(found: list[Deviations]) -> dict[str, FloatArray]:
    """Deviations of fitted parameters, in u, by name over all samples."""
    names = sorted({name for one in found for name in one.parameters})
    return {
        name: np.array([one.parameters[name] for one in found if name in one.parameters])
        for name in names
    }
