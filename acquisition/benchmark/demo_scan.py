"""The demonstration's protocol and rig, as the simulated scans of the bench use them.

They are those of configs/protocols/demo.yaml and configs/rigs/bench_12bit.yaml (a test compares
them), but for a camera whose pixels are binned, so that a hundred scans take a minute.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from instrument.config.load import Loaded
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig

BINNING = 2
"""Pixels a side that are taken together: 4 of them hold 4 times the electrons.

Not more: with 4 a side the sample's mottling, cut by coarse pixels at the window's edge, would add
to the roughness as much error as all else does."""


def _motor(low_deg: float, high_deg: float) -> dict[str, Any]:
    return {
        "driver": "simulated", "min_deg": low_deg, "max_deg": high_deg, "speed_deg_per_s": 20.0,
        "acceleration_deg_per_s2": 40.0, "settle_s": 0.3, "backlash_deg": 0.5, "u_deg": 0.02,
    }  # fmt: skip


RIG: dict[str, Any] = {
    "name": "bench_12bit",
    "description": "three motors, 640 x 512 pixels of 12 bit on an 800 mm beam",
    "beam_length_mm": 800.0,
    "lamp_distance_mm": 1000.0,
    "source_solid_angle_sr": 0.0005,
    "receiver_solid_angle_sr": 0.0003,
    "blocked_half_angle_deg": 3.0,
    "u_placement_mm": 0.2,
    "swap_s": 45.0,
    "axes": {
        "theta_i": _motor(-1.0, 85.0),
        "dphi": _motor(-1.0, 181.0),
        "theta_r": _motor(-88.0, 88.0),
    },
    "keep_out": [{"name": "cable post behind the table", "theta_r_deg": [-90.0, -87.0]}],
    "camera": {
        "driver": "simulated", "width_px": 640, "height_px": 512, "field_width_mm": 72.0,
        "axis_row_px": 257.5, "axis_column_px": 317.0, "roll_deg": 0.4, "bit_depth": 12,
        "full_well_electrons": 30000.0, "read_noise_electrons": 8.0,
        "dark_current_electrons_per_s": 20.0, "black_level_dn": 64.0, "min_exposure_s": 0.0005,
        "max_exposure_s": 2.0, "frame_overhead_s": 0.02,
    },
    "lamp": {
        "driver": "simulated", "darkened_by": "shutter", "shutter_s": 0.1,
        "white_electrons_per_s": 600000.0,
    },
    "simulation": {"seed": 2026, "sample_height_mm": 0.15, "lamp_drift_per_hour": 0.01},
}  # fmt: skip

PROTOCOL: dict[str, Any] = {
    "name": "demo",
    "description": "foam (Oren and Nayar 1995, sample D) at three incidences",
    "rig": "../rigs/bench_12bit.yaml",
    "sample": {"name": "foam", "width_mm": 50.8, "height_mm": 50.8},
    "sweeps": [
        {
            "theta_i_deg": [30.0, 45.0, 60.0],
            "dphi_deg": [0.0],
            "theta_r_deg": {"start": -80.0, "stop": 80.0, "num": 33},
        }
    ],
    "window": {"width_mm": 20.0, "height_mm": 20.0},
    "frames_per_point": 4,
    "exposure_target": 0.7,
    "references": {
        "white_tile": {"reflectance": 0.99, "u_reflectance": 0.005, "theta_r_deg": 10.0},
        "drift_check": {"theta_r_deg": 10.0, "every_points": 25},
    },
    "simulated_sample": {
        "model": "oren_nayar+torrance_sparrow",
        "parameters": {"albedo": 0.80, "sigma_deg": 20.0, "ks": 0.076},
        "mottling": 0.02,
        "mottling_size_mm": 2.0,
    },
}


def binned(rig: dict[str, Any]) -> dict[str, Any]:
    """The rig with BINNING x BINNING pixels taken together: as many electrons in all."""
    whole, camera = rig["camera"], dict(rig["camera"])
    for key in ("width_px", "height_px"):
        camera[key] = whole[key] // BINNING
    for key in ("axis_row_px", "axis_column_px"):
        camera[key] = (whole[key] + 0.5) / BINNING - 0.5
    for key in ("full_well_electrons", "dark_current_electrons_per_s"):
        camera[key] = whole[key] * BINNING**2
    camera["read_noise_electrons"] = whole["read_noise_electrons"] * BINNING
    lamp = dict(rig["lamp"])
    lamp["white_electrons_per_s"] = rig["lamp"]["white_electrons_per_s"] * BINNING**2
    return {**rig, "camera": camera, "lamp": lamp}


def demonstration(
    *, views: int = 33, frames: int = 4, exposure_target: float = 0.7, seed: int = 2026
) -> Loaded:
    """The demonstration with other settings and another seed, its camera binned.

    `views`: view angles from -80 to 80 degrees at each incidence; `frames`: of each point;
    `exposure_target`: part of full scale. The smallest window then still has its pixels.
    """
    sweep = PROTOCOL["sweeps"][0]
    steps = {**sweep["theta_r_deg"], "num": views}
    protocol = Protocol.model_validate(
        {
            **PROTOCOL,
            "sweeps": [{**sweep, "theta_r_deg": steps}],
            "frames_per_point": frames,
            "exposure_target": exposure_target,
            "window": {**PROTOCOL["window"], "min_pixels": 100 // BINNING**2},
        }
    )
    rig = Rig.model_validate({**binned(RIG), "simulation": {**RIG["simulation"], "seed": seed}})
    nowhere = Path("demonstration")
    return Loaded(protocol, nowhere, "", rig, nowhere, "")
