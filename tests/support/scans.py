"""Small scans derived from the demonstration, and simulated scenes for them."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import DriftCheck, References, WhiteTile
from instrument.config.rig import Rig
from instrument.record.reading import Reading
from sim.scene.scene import Scene
from tests.support.paths import CONFIGS

TWO_MODELS = "lambert, oren_nayar+torrance_sparrow"
"""Candidates that are fitted in a tenth of a second; the demonstration's sample is the second."""


def small_scan(rig: str = "bench_12bit", shrink: int = 5) -> Loaded:
    """The demonstration with ten points and 1/shrink of the camera's rows and columns."""
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
    return changed(shrunk(demo, shrink), sweeps=[sweep], references=references)


def shortest_scan() -> Loaded:
    """`small_scan` with small pictures, two views at each incidence, a drift check after each two.

    Nine steps: two of the tile, a drift check, and twice two points and a drift check. The sample
    renders fast.
    """
    loaded = small_scan(shrink=10)
    (sweep,), references = loaded.protocol.sweeps, loaded.protocol.references
    sample = loaded.protocol.simulated_sample
    assert sample is not None
    matt = {"model": "lambert", "parameters": {"albedo": 0.8}}
    often = DriftCheck(theta_r_deg=10.0, every_points=2)
    return changed(
        loaded,
        sweeps=[{**sweep, "theta_r_deg": [-35.0, 35.0]}],
        references=references.model_copy(update={"drift_check": often}),
        simulated_sample=sample.model_copy(update=matt),
    )


def shrunk(loaded: Loaded, times: int) -> Loaded:
    """Copy of the configuration with 1/times of the camera's rows and columns."""
    camera = loaded.rig.camera
    small = camera.model_copy(
        update={
            "width_px": camera.width_px // times,
            "height_px": camera.height_px // times,
            "axis_row_px": camera.axis_row_px / times,
            "axis_column_px": camera.axis_column_px / times,
        }
    )
    return changed(loaded, rig={"camera": small})


def undated(readings: list[Reading]) -> list[Reading]:
    """Readings without what differs between equal scans: the date, and `free_s` by its rounding."""
    return [replace(r, time_utc="", free_s=0.0) for r in readings]


def small_rig(folder: Path, rig: str = "bench_12bit", shrink: int = 5) -> Path:
    """Write a rig with 1/shrink of its camera's rows and columns into `folder`."""

    def shrunken(found: re.Match[str]) -> str:
        number = float(found[2]) / shrink
        return f"{found[1]}{number if '.' in found[2] else int(number)}"

    text = (CONFIGS / "rigs" / f"{rig}.yaml").read_text()
    for name in ("width_px", "height_px", "axis_row_px", "axis_column_px"):
        text = re.sub(rf"({name}: )([\d.]+)", shrunken, text)
    path = folder / "small_rig.yaml"
    path.write_text(text)
    return path


def small_demo(folder: Path, models: str = "") -> Path:
    """Write the demonstration with two incidences, nine view angles and few pixels into `folder`.

    models: the candidates of its fit, empty for the automatic choice.
    """
    text = (CONFIGS / "protocols" / "demo.yaml").read_text()
    text = text.replace("[30.0, 45.0, 60.0]", "[30.0, 60.0]").replace("num: 33", "num: 9")
    text = text.replace("../rigs/bench_12bit.yaml", str(small_rig(folder)))
    path = folder / "small.yaml"
    path.write_text(text + (f"fit: {{models: [{models}]}}\n" if models else ""))
    return path


def changed(loaded: Loaded, rig: dict[str, Any] | None = None, **protocol: Any) -> Loaded:
    """Copy of the configuration with some entries replaced, without validation."""
    return replace(
        loaded,
        rig=loaded.rig.model_copy(update=rig or {}),
        protocol=loaded.protocol.model_copy(update=protocol),
    )


def exact_rig(rig: Rig) -> Rig:
    """Copy of the rig without simulated errors: exact angles and heights, constant lamp."""
    axes = rig.axes.model_copy(
        update={
            n: rig.axes[n].model_copy(update={"u_deg": 0.0}) for n in ("theta_i", "dphi", "theta_r")
        }
    )
    simulation = rig.simulation.model_copy(
        update={"sample_height_mm": 0.0, "lamp_drift_per_hour": 0.0}
    )
    return rig.model_copy(update={"axes": axes, "simulation": simulation, "u_placement_mm": 0.0})


def simulated_scene(loaded: Loaded, theta_i: float = 45.0, theta_r: float = 0.0) -> Scene:
    """Scene of the protocol's simulated sample at these angles, with dphi = 0."""
    scene = Scene.of(loaded.rig, loaded.protocol)
    for axis, angle in (("theta_i", theta_i), ("dphi", 0.0), ("theta_r", theta_r)):
        scene.set_axis(axis, angle)
    return scene
