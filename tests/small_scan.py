"""A scan that takes some tens of milliseconds: a small camera, two incidences, all references."""

from __future__ import annotations

from dataclasses import replace

from conftest import CONFIGS, changed

from instrument.config import Loaded, load_protocol
from instrument.protocol_config import DriftCheck, References, WhiteTile
from instrument.reading import Reading

SHRINK = 5


def small_scan(rig: str = "bench_12bit", shrink: int = SHRINK) -> Loaded:
    """The demo's foam on a rig file of configs, its camera with one pixel in 25 (or shrink^2)."""
    path = CONFIGS / "rigs" / f"{rig}.yaml"
    demo = load_protocol(CONFIGS / "protocols" / "demo.yaml", path)
    sweep = {
        "theta_i_deg": [30.0, 60.0],
        "dphi_deg": [0.0],
        "theta_r_deg": [-70.0, -35.0, 0.0, 35.0, 70.0],
    }
    references = References(
        white_tile=WhiteTile(reflectance=0.99, u_reflectance=0.005, theta_r_deg=10.0, frames=4),
        drift_check=DriftCheck(theta_r_deg=10.0, every_points=4),
    )
    camera = demo.rig.camera
    small = camera.model_copy(
        update={
            "width_px": camera.width_px // shrink,
            "height_px": camera.height_px // shrink,
            "axis_row_px": camera.axis_row_px / shrink,
            "axis_column_px": camera.axis_column_px / shrink,
        }
    )
    return changed(demo, rig={"camera": small}, sweeps=[sweep], references=references)


def undated(readings: list[Reading]) -> list[Reading]:
    """All but the date and a sum of times that is rounded otherwise; `time_s` stays."""
    return [replace(r, time_utc="", free_s=0.0) for r in readings]
