"""Curves of a plan: over the angle that the sweep moves, one for each setting of the others."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.live.following.curves import Curves
from acquisition.plan.plan import make_plan
from instrument.config.load import Loaded, load_protocol
from tests.support.live.runs import live_protocol
from tests.support.paths import CONFIGS
from tests.support.scans import changed

SHIPPED = sorted((CONFIGS / "protocols").glob("*.yaml"))


@pytest.fixture
def loaded(tmp_path: Path) -> Loaded:
    return live_protocol(tmp_path)


@pytest.mark.parametrize(
    ("theta_i", "dphi", "theta_r", "sweep", "names"),
    [
        ([30.0, 60.0], [0.0], [-40.0, 10.0, 40.0], "theta_r", {"θᵢ 30°", "θᵢ 60°"}),
        ([30.0], [0.0], [10.0], "theta_r", {"θᵢ 30°"}),
        ([30.0], [0.0, 90.0], [10.0, 20.0, 40.0], "theta_r", {"θᵢ 30°, Δφ 0°", "θᵢ 30°, Δφ 90°"}),
        ([20.0, 30.0, 40.0, 50.0], [0.0], [10.0], "theta_i", {"θᵣ 10°"}),
        ([30.0], [0.0, 60.0, 120.0], [15.0], "dphi", {"θᵢ 30°"}),
        (
            [30.0],
            [0.0, 60.0, 120.0],
            [15.0, 45.0],
            "theta_r",
            {"θᵢ 30°, Δφ 0°", "θᵢ 30°, Δφ 60°", "θᵢ 30°, Δφ 120°"},
        ),
    ],
)
def test_the_angle_that_moves_most_is_the_abscissa(
    loaded: Loaded, theta_i: list[float], dphi: list[float], theta_r: list[float],
    sweep: str, names: set[str],
) -> None:  # fmt: skip
    plan = make_plan(
        changed(loaded, sweeps=[{"theta_i_deg": theta_i, "dphi_deg": dphi, "theta_r_deg": theta_r}])
    )
    curves = Curves.of(plan)
    assert curves.sweep == sweep
    assert {curves.name_of(_Reading(*step.pose)) for step in plan.points} == names


class _Reading:
    def __init__(self, theta_i: float, dphi: float, theta_r: float) -> None:
        self.theta_i_deg, self.dphi_deg, self.theta_r_deg = theta_i, dphi, theta_r


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_no_two_points_of_a_curve_are_at_the_same_place(path: Path) -> None:
    plan = make_plan(load_protocol(path))
    curves = Curves.of(plan)
    places = [
        (curves.name_of(r), curves.x_deg(r)) for r in (_Reading(*s.pose) for s in plan.points)
    ]
    assert len(set(places)) == len(places)
    assert all(curves.range_deg[0] <= x <= curves.range_deg[1] for _, x in places)
