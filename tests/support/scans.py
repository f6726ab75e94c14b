"""Small scans: the demonstration with fewer angles, a small camera or changed entries."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import DriftCheck, References, WhiteTile
from instrument.config.rig import Rig
from instrument.record.reading import Reading
from tests.support.paths import CONFIGS

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


def small_demo(folder: Path) -> Path:
    """The demo's protocol in that folder, with two incidences and nine view angles."""
    text = (CONFIGS / "protocols" / "demo.yaml").read_text()
    text = text.replace("[30.0, 45.0, 60.0]", "[30.0, 60.0]").replace("num: 33", "num: 9")
    path = folder / "small.yaml"
    path.write_text(text.replace("../rigs/", f"{CONFIGS / 'rigs'}/"))
    return path


def changed(loaded: Loaded, rig: dict[str, Any] | None = None, **protocol: Any) -> Loaded:
    """The same configuration with some entries replaced (not validated again)."""
    return replace(
        loaded,
        rig=loaded.rig.model_copy(update=rig or {}),
        protocol=loaded.protocol.model_copy(update=protocol),
    )


def exact_rig(rig: Rig) -> Rig:
    """The rig as its file says it is: true angles, sample on the axis, a constant lamp."""
    axes = rig.axes.model_copy(
        update={
            n: rig.axes[n].model_copy(update={"u_deg": 0.0}) for n in ("theta_i", "dphi", "theta_r")
        }
    )
    simulation = rig.simulation.model_copy(
        update={"sample_height_mm": 0.0, "lamp_drift_per_hour": 0.0}
    )
    return rig.model_copy(update={"axes": axes, "simulation": simulation})
