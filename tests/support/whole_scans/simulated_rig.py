"""The emulated rig in less time, the simulated twin of a rig with real drivers, points of a run."""

from __future__ import annotations

import csv
from pathlib import Path

import yaml

from tests.support.paths import CONFIGS

EMULATED_RIG = CONFIGS / "rigs" / "emulated.yaml"
_DRIVERS_OWN = ("port", "model", "parity", "steps_per_deg", "microsteps_per_deg", "reply_s")


def quick_emulated_rig() -> str:
    """Return the text of the emulated rig with short homing and pixels twice as wide.

    Rendering takes most of the time, and of an axis that moves each frame is rendered several
    times.
    """
    text = EMULATED_RIG.read_text()
    changes = {"homing_s: 2.0": "homing_s: 0.2", "width_px: 320": "width_px: 160",
               "height_px: 256": "height_px: 128", "row_px: 128.5": "row_px: 64.0",
               "column_px: 158.0": "column_px: 78.75"}  # fmt: skip
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    return text


def simulated(text: str) -> str:
    """Return the text of a rig file with simulated devices in place of drivers."""
    rig = yaml.safe_load(text)
    for axis in rig["axes"].values():
        for key in _DRIVERS_OWN:
            axis.pop(key, None)
        axis["driver"] = "simulated"
    for key in ("device", "pixel_format", "exposure_delay_frames", "frames_per_s"):
        rig["camera"].pop(key)
    rig["camera"]["driver"] = "simulated"
    rig["lamp"].pop("cover_s", None)
    rig["lamp"] |= {"driver": "simulated", "darkened_by": "shutter"}
    return str(yaml.safe_dump(rig))


Points = dict[tuple[float, ...], tuple[float, float]]


def points(folder: Path) -> Points:
    """Return BRDF and its uncertainty of each geometry of a run, both in 1/sr."""
    with (folder / "measurements.csv").open() as file:
        return {
            tuple(float(row[k]) for k in ("theta_i_deg", "dphi_deg", "theta_r_deg")):
            (float(row["brdf"]), float(row["u_brdf"]))
            for row in csv.DictReader(file)
        }  # fmt: skip


def assert_same_within_noise(first: Points, second: Points) -> None:
    """Assert that two runs of the same scene differ by their noise only."""
    assert first.keys() == second.keys()
    deviations = [(f - g) / (u**2 + v**2) ** 0.5 for (f, u), (g, v) in
                  ((first[k], second[k]) for k in first)]  # fmt: skip
    assert max(map(abs, deviations)) < 4.5
    assert sum(d * d for d in deviations) / len(deviations) < 1.5
