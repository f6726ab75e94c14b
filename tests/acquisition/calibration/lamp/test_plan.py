"""Plan of a lamp's calibration: numbers and poses that are refused, and its words."""

from __future__ import annotations

from typing import Any

import pytest

from acquisition.calibration.lamp.plan import LampPlan
from instrument.config.load import load_rig
from instrument.errors import InputError
from tests.support.paths import CONFIGS

RIGS = sorted((CONFIGS / "rigs").glob("*.yaml"))
BENCH = load_rig(CONFIGS / "rigs" / "bench_12bit.yaml")


@pytest.mark.parametrize("path", RIGS, ids=lambda p: p.stem)
def test_every_rig_has_a_plan(path: Any) -> None:
    plan = LampPlan(rig=load_rig(path))
    assert plan.shortest_s == 120
    assert any("nothing moves" in line for line in plan.lines())
    assert plan.point_s(0.01) > 0
    assert plan.patch().sum() > 100


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"minutes": 0.5}, "--minutes 0.5; allowed: 1 to 720"),
        ({"minutes": 1.5}, "--minutes 1.5 is too short.*at least 2"),
        ({"minutes": 2.0, "every_s": 60.0}, "--minutes 2 is too short.*--every-s 60.*at least 7"),
        ({"every_s": float("nan")}, "--every-s nan; allowed: 0.5 to 600"),
        ({"frames": 1}, "--frames 1; allowed: 2 to 64"),
        ({"limit_percent": 0.0}, "--limit-percent 0; allowed: 0.001 to 10"),
        ({"within_minutes": -1.0}, "--within-minutes -1; allowed: 0.5 to 600"),
        ({"window_mm": 60.0}, "--window-mm 60; allowed: up to that of the tile, --tile-mm 50"),
        ({"window_mm": 90.0, "tile_mm": 90.0}, "--window-mm 90: this square leaves the picture"),
        ({"theta_i_deg": 86.0}, "--theta-i-deg 86; allowed: -1 to 85 deg"),
        ({"theta_r_deg": 29.0}, "--theta-r-deg 29 is 1 deg from the lamp; allowed: 3 or more"),
    ],
)
def test_what_determines_nothing_is_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=f"gonio calibrate lamp: {words}.*Nothing has been"):
        LampPlan(rig=BENCH, **options)
