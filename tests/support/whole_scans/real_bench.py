"""Runs on the simulated bench with all defects of a real one drawn anew, against the truth.

A run is what a user would measure who has calibrated the bench: the tile has a table with a stated
u; the camera's response was measured, up to a residual non-linearity. Frames have a quarter of the
rows and columns, with the sizes of defects in pixels to match: a window's mean is the same.
"""

from __future__ import annotations

from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np

from acquisition.benchmark.corrections.real_bench import drawn_defects
from acquisition.results.fitting import measurements
from acquisition.results.reduction import reduced_run
from analysis.data.measurements import Measurements
from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import DriftCheck, References
from instrument.config.rig import Rig, Simulation
from instrument.config.simulated.sample import SimulatedSample
from instrument.record.record import Record
from tests.support.paths import CONFIGS
from tests.support.scans import changed, shrunk
from tests.support.white_tiles import table_text, tabled
from tests.support.whole_scans.coverage_scans import Deviations, deviations
from tests.support.whole_scans.stopped_scan import scan

SAMPLES = (
    SimulatedSample(model="oren_nayar", parameters={"albedo": 0.8, "sigma_deg": 30.0}),
    SimulatedSample(model="oren_nayar", parameters={"albedo": 0.15, "sigma_deg": 20.0}),
    SimulatedSample(model="lambert+ggx", parameters={"albedo": 0.4, "f0": 0.04, "alpha": 0.35}),
    SimulatedSample(
        model="oren_nayar+torrance_sparrow",
        parameters={"albedo": 0.6, "sigma_deg": 20.0, "ks": 0.076},
    ),
)
# At those of the tile's table: between them its linear interpolation is up to 0.2 % too low.
INCIDENCES_DEG = ((15.0, 45.0), (30.0, 60.0), (15.0, 60.0), (30.0, 45.0))
VIEWS_DEG = (-83.0, -78.0, -70.0, -62.0, -50.0, -35.0, -20.0, -5.0, 10.0, 25.0, 50.0, 68.0, 80.0)
_U_TILE, _U_TILE_COMMON = 0.002, 0.005  # of each value of the table, and of all
_SHRINK = 4
_U_LINEARITY = 0.001  # left over by the calibration of the camera's response
_CUT_OFF = 0.88  # standard deviation of drawn errors in units of their spread: none is beyond 2


def real_bench_run(
    number: int,
    folder: Path,
    series: int = 600,
    frames: int = 2,
    lines: dict[str, Any] | None = None,
) -> Loaded:
    """Configuration of run `number`, which is its seed, of a series.

    `lines` replace some of the rig's.
    """
    sweep = {
        "theta_i_deg": list(INCIDENCES_DEG[number // len(SAMPLES) % len(INCIDENCES_DEG)]),
        "dphi_deg": [0.0],
        "theta_r_deg": list(VIEWS_DEG),
    }
    return changed(
        _on_drawn_bench("demo", 7, number, folder, series, lines or {}),
        sweeps=[sweep],
        frames_per_point=frames,
        simulated_sample=SAMPLES[number % len(SAMPLES)],
    )


def plaster_run(number: int, folder: Path, series: int, views: int) -> Loaded:
    """Configuration of run `number` of a series: sample A of the paper, with so many views."""
    loaded = _on_drawn_bench("plaster_a", 25, number, folder, series, {})
    (sweep,) = loaded.protocol.sweeps
    return changed(loaded, sweeps=[{**sweep, "theta_r_deg": list(np.linspace(-75, 75, views))}])


def _on_drawn_bench(
    protocol: str, every_points: int, number: int, folder: Path, series: int, lines: dict[str, Any]
) -> Loaded:
    """A shipped protocol on a calibrated bench with drawn defects, with drift checks.

    The error of the tile's certificate, the largest of all, takes each part of its distribution
    once in the series.
    """
    loaded = load_protocol(
        CONFIGS / "protocols" / f"{protocol}.yaml", CONFIGS / "rigs" / "bench_real.yaml"
    )
    small = shrunk(loaded, _SHRINK)
    rig = _drawn_rig(small.rig, number, lines)
    tile = rig.simulation.tile
    assert tile is not None
    new = tile.model_copy(update={"aged": 0.0})
    part = (np.random.default_rng(series).permutation(series)[number] + 0.5) / series
    common = NormalDist().inv_cdf(part)
    text = table_text(new, _U_TILE, _U_TILE_COMMON, np.random.default_rng([number, 3]), common)
    references = References(
        white_tile=tabled(text, folder, frames=4),
        drift_check=DriftCheck(theta_r_deg=10.0, every_points=every_points),
    )
    return changed(
        small,
        rig={"uncertainty": rig.uncertainty, "simulation": rig.simulation},
        references=references,
    )


def _drawn_rig(rig: Rig, seed: int, lines: dict[str, Any]) -> Rig:
    """The rig with its defects drawn, for pictures of fewer pixels, and a calibrated camera."""
    own = drawn_defects(rig, seed, _SHRINK)
    own["camera_defects"]["nonlinearity"] = _U_LINEARITY
    stated = {"u_linearity": _CUT_OFF * _U_LINEARITY}
    if rig.uncertainty.u_pixel_response:
        stated["u_pixel_response"] = rig.uncertainty.u_pixel_response / _SHRINK
    known = rig.uncertainty.model_copy(update={**stated, **lines})
    update = {"simulation": Simulation.model_validate(own), "uncertainty": known}
    return rig.model_copy(update=update)


def pulls_of(loaded: Loaded, folder: Path) -> Deviations:
    """Scan, reduce, and fit the true model; compare with the truth."""
    return deviations(measured(loaded, folder), loaded)


def measured(loaded: Loaded, folder: Path) -> Measurements:
    """Scan and reduce; return the values as a fit takes them."""
    with Record.create(folder, {}) as record:
        scan(loaded, record)
        return measurements(reduced_run(record, loaded), loaded)
