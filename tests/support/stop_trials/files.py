"""Files of one trial: the rig, and for a scan its protocol."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from sim.emulated.zaber_controller import MICROSTEPS_PER_DEG
from tests.support.paths import CONFIGS
from tests.support.stages.bench_rig import write_bench_rig
from tests.support.stop_trials.bench import STEPS_PER_DEG
from tests.support.stop_trials.trial import MAX_DEG, MIN_DEG, Trial

U_DEG = 0.02
_SHRINK = 5  # of the camera's rows and columns
PROTOCOL = {
    "name": "stop", "rig": "scene.yaml",
    "sample": {"name": "foam", "width_mm": 50.0, "height_mm": 50.0},
    "sweeps": [
        {"theta_i_deg": [70.0], "dphi_deg": [0.0], "theta_r_deg": [-60.0, 20.0, -45.0, 50.0]}
    ],
    "window": {"width_mm": 20.0, "height_mm": 20.0},
    "simulated_sample": {"model": "lambert", "parameters": {"albedo": 0.8}},
}  # fmt: skip


def rig_file(folder: Path) -> Path:
    """Path of the rig file that names the axis' port."""
    return folder / "rig.yaml"


def write_files(trial: Trial, folder: Path, port: str) -> None:
    """Write the rig with the real axis; for a scan also the scene and the protocol."""
    write_bench_rig(rig_file(folder), theta_r=_axis(trial, port))
    if trial.command == "run":
        (folder / "scene.yaml").write_text(yaml.safe_dump(_scene(trial)))
        (folder / "protocol.yaml").write_text(yaml.safe_dump(PROTOCOL))


def _axis(trial: Trial, port: str) -> dict[str, Any]:
    driver: dict[str, Any]
    match trial.controller:
        case "zaber":
            driver = {"driver": "zaber", "microsteps_per_deg": MICROSTEPS_PER_DEG}
        case "smc100":
            driver = {"driver": "newport", "model": "SMC100"}
        case "conex":
            driver = {"driver": "newport", "model": "CONEX-CC"}
        case _:  # pseudo-terminals have no parity
            driver = {"driver": "oriental", "parity": "N", "steps_per_deg": STEPS_PER_DEG}
    return {
        **driver, "port": port, "min_deg": MIN_DEG, "max_deg": MAX_DEG, "settle_s": 0.0,
        "homing_s": trial.homing_s + 3.0, "u_deg": U_DEG,
        "speed_deg_per_s": trial.speed_deg_per_s,
        "acceleration_deg_per_s2": trial.acceleration_deg_per_s2,
    }  # fmt: skip


def _scene(trial: Trial) -> dict[str, Any]:
    """Return the simulated rest of the rig, with small pictures and the real axis' speed."""
    scene: dict[str, Any] = yaml.safe_load((CONFIGS / "rigs" / "bench_12bit.yaml").read_text())
    camera = scene["camera"]
    for key in ("width_px", "height_px"):
        camera[key] //= _SHRINK
    for key in ("axis_row_px", "axis_column_px"):
        camera[key] /= _SHRINK
    scene["axes"]["theta_r"] |= {
        "min_deg": MIN_DEG, "max_deg": MAX_DEG, "speed_deg_per_s": trial.speed_deg_per_s,
        "acceleration_deg_per_s2": trial.acceleration_deg_per_s2,
    }  # fmt: skip
    return scene


def arguments(trial: Trial, folder: Path) -> list[str]:
    """Return the command line of the trial."""
    rig = ["--rig", str(rig_file(folder)), "--yes"]
    match trial.command:
        case "move":
            return ["move", "theta_r", f"{trial.target_deg:.4f}", *rig]
        case "home":
            return ["home", "theta_r", *rig]
    return ["run", str(folder / "protocol.yaml"), "--out", str(folder / "run")]


def next_arguments(trial: Trial, folder: Path) -> list[str]:
    """Return the command with which a person would go on."""
    if trial.command == "run" and (folder / "run" / "record.sqlite").exists():
        return ["resume", str(folder / "run"), "--yes"]
    if trial.command == "move":
        trial = replace(trial, target_deg=trial.start_deg)
    return arguments(trial, folder)
