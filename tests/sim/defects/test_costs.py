"""Costs of defects of a bench in the measured BRDF, as the program's own reduction finds them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.results.reduction import reduced_run
from instrument.config.load import Loaded
from instrument.config.rig import Simulation
from instrument.geometry import FloatArray
from instrument.record.record import Record
from tests.support.scans import changed, small_scan
from tests.support.whole_scans.stopped_scan import scan

# Each defect alone on the demonstration's rig, with theta_i 30 and 60 deg and 21 view angles:
# largest of the medians of |change of the BRDF| in % below 60, at 60 to 75 and at 75 to 84 deg, as
# measured when the defects were first put into a copy of the simulation (bench-defects.md).
COSTS: dict[str, tuple[dict[str, Any], float]] = {
    "non-linearity 3 %": ({"camera_defects": {"nonlinearity": 0.03}}, 0.43),
    "glare 2 %": ({"lens_defects": {"glare": 0.02}}, 1.16),
    "tilt 0.2 deg": ({"sample_placement": {"tilt_deg": 0.2}}, 0.31),
    "warm-up 5 %": ({"lamp_defects": {"warm_up": 0.05, "warm_up_s": 60.0}}, 0.66),
    "flicker 0.3 %": ({"lamp_defects": {"flicker": 0.003}}, 0.21),
    "walls 0.5 %": ({"wall_light": 0.005}, 0.20),
    "sag 2 px": ({"axis_defects": {"theta_r": {"sag_px": 2.0}}}, 0.21),
    "vignetting 10 %": ({"lens_defects": {"vignetting": 0.1, "axis_column_px": 64.0}}, 0.14),
    "defocus 6 px": ({"lens_defects": {"defocus_px": 6.0}}, 0.13),
    "tile 1 mm higher": ({"tile_height_mm": 1.0}, 0.09),
    "zero 0.1 deg": ({"axis_defects": {"theta_i": {"zero_deg": 0.1}}}, 0.06),
}
# Those of which only was found that they cost no more than this: dark current becomes tenfold.
LITTLE: dict[str, tuple[dict[str, Any], float]] = {
    "PRNU 1 %": ({"camera_defects": {"prnu": 0.01}}, 0.06),
    "distortion 1 %": ({"lens_defects": {"distortion": -0.01}}, 0.06),
    "beam 130 mm wide": ({"lamp_defects": {"spot_fwhm_mm": 130.0}}, 0.06),
    "warmer camera": ({"camera_defects": {"warming_k": 23.25, "warming_s": 60.0}}, 0.06),
}


def _brdf(
    base: Loaded, folder: Path, defects: dict[str, Any], view_angles: int
) -> tuple[FloatArray, FloatArray]:
    """View angles and BRDF of a scan with these defects."""
    own = Simulation.model_validate({**base.rig.simulation.model_dump(), **defects})
    sweep = {
        "theta_i_deg": [30.0, 60.0],
        "dphi_deg": [0.0],
        "theta_r_deg": np.linspace(-84.0, 84.0, view_angles).tolist(),
    }
    loaded = changed(base, rig={"simulation": own}, sweeps=[sweep])
    with Record.create(folder, {}) as record:
        scan(loaded, record)
        reduced = reduced_run(record, loaded)
    return np.array([p.theta_r_deg for p in reduced.points]), reduced.brdf


def _cost(view_deg: FloatArray, change: FloatArray) -> list[float]:
    bands = ((0.0, 60.0), (60.0, 75.0), (75.0, 85.0))
    view = np.abs(view_deg)
    parts = [np.abs(change[(view >= low) & (view < high)]) for low, high in bands]
    return [float(100 * np.nanmedian(part)) for part in parts]


@pytest.mark.slow
def test_each_defect_costs_what_was_measured(demo: Loaded, tmp_path: Path, slow: bool) -> None:
    """The share of a normal run is one of them, on a small picture."""
    loaded, costs = (demo, COSTS | LITTLE) if slow else (small_scan(), {"tilt 0.2 deg"})
    num = 21 if slow else 8
    view, sound = _brdf(loaded, tmp_path / "sound", {}, num)
    for number, name in enumerate(costs):
        defects, expected = (COSTS | LITTLE)[name]
        _, brdf = _brdf(loaded, tmp_path / str(number), defects, num)
        found = _cost(view, brdf / sound - 1)
        assert max(found) < 3 * expected, (name, found)
        assert name in LITTLE or max(found) > expected / 3, (name, found)
