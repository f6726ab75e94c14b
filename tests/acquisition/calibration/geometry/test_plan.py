"""Plan of a geometry calibration: poses within limits and keep-outs, and what is refused."""

from __future__ import annotations

from typing import Any

import pytest

from acquisition.calibration.geometry.plan import GeometryPlan
from instrument.board import Board
from instrument.config.load import load_rig
from instrument.config.rig import KeepOut, Rig
from instrument.errors import InputError
from tests.support.paths import CONFIGS

RIG = load_rig(CONFIGS / "rigs" / "bench_12bit.yaml")
BEHIND = KeepOut(name="post", theta_r_deg=[-90.0, -45.0])


def test_poses_spread_evenly_and_leave_out_the_lamp_and_keep_out_zones() -> None:
    plan = GeometryPlan(rig=RIG, poses=9, theta_i_deg=31.0)
    assert [p.theta_r for p in plan.usable()] == [-60, -45, -30, -15, 0, 15, 45, 60]
    assert [why for _, why in plan.left_out()] == ["theta_r 30: 1 deg from the lamp"]
    fenced = RIG.model_copy(update={"keep_out": [BEHIND]})
    fewer = GeometryPlan(rig=fenced, poses=9, theta_i_deg=70.0)
    assert [p.theta_r for p in fewer.usable()] == [-30, -15, 0, 15, 30, 45, 60]
    assert "left out: theta_r -60: keep-out zone post" in list(fewer.lines())


def test_the_words_hold_every_pose() -> None:
    words = "\n".join(GeometryPlan(rig=RIG, poses=9).lines())
    assert "8 angles, 4 frames at each: -60, -45, -30, -15, 0, 15, 45, 60 deg" in words
    assert "6 x 6 squares of 8 mm" in words


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"poses": 4}, "--poses 4; allowed: 5 to 60"),
        ({"frames": 0}, "--frames 0; allowed: 1 to 64"),
        ({"widest_deg": 80.0}, "--widest-deg 80; allowed: 30 to 75"),
        ({"theta_i_deg": 86.0}, "--theta-i-deg 86: theta_i would go to 86 deg; allowed by the rig"),
        ({"dphi_deg": -5.0}, "--dphi-deg -5: dphi would go to -5 deg; allowed by the rig: -1 to"),
        ({"u_square_mm": 1.0}, "--u-square-mm 1; allowed: 0 to 0.8 mm"),
        ({"board": Board(square_mm=12.0)}, "--square-mm 12: .* leave the picture, 72 mm wide"),
        ({"poses": float("nan")}, "--poses nan; allowed"),
    ],
)
def test_what_cannot_work_is_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words) as refused:
        GeometryPlan(rig=RIG, **options)
    assert str(refused.value).endswith("Nothing has moved")


def narrow(low: float, high: float) -> Rig:
    axis = RIG.axes.theta_r.model_copy(update={"min_deg": low, "max_deg": high})
    return RIG.model_copy(update={"axes": RIG.axes.model_copy(update={"theta_r": axis})})


def test_limits_and_keep_outs_that_leave_too_little_are_refused() -> None:
    with pytest.raises(InputError, match=r"--widest-deg 60: theta_r would go to 60 .* -88 to 50"):
        GeometryPlan(rig=narrow(-88.0, 50.0))
    zone = KeepOut(name="wall", theta_r_deg=[-90.0, -5.0])
    walled = RIG.model_copy(update={"keep_out": [zone]})
    with pytest.raises(InputError, match=r"can be used; needed: 5, .*keep-out zone wall"):
        GeometryPlan(rig=walled, theta_i_deg=70.0, poses=7)
