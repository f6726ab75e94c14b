"""Rig file of a bench with real devices, for tests that name some of its axes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from tests.support.paths import CONFIGS

HAND = {"driver": "hand", "min_deg": -90.0, "max_deg": 90.0, "u_deg": 0.1}


def write_bench_rig(path: Path, **axes: dict[str, Any]) -> Path:
    """Write a rig of real devices with these axes; others are set by hand."""
    rig = yaml.safe_load((CONFIGS / "rigs" / "emulated.yaml").read_text())
    rig["axes"] = {name: dict(axes.get(name, HAND)) for name in rig["axes"]}
    rig["camera"]["device"] = "/dev/v4l/by-id/camera"
    rig["lamp"] = {"driver": "manual", "darkened_by": "hand", "white_electrons_per_s": 1e6}
    path.write_text(yaml.safe_dump(rig))
    return path
