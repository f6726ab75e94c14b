"""Keep-out zones: the closest approach along a move is found, wherever it is."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from acquisition.plan.keep_out import enters_zone
from acquisition.plan.pose import Pose
from instrument.config.rig import KeepOut
from instrument.geometry import camera_to_lamp_deg


@given(
    theta_i=st.floats(5, 80), dphi=st.floats(0, 180), start=st.floats(-85, 85),
    end=st.floats(-85, 85), cone=st.floats(0.5, 10),
)  # fmt: skip
def test_the_closest_approach_is_not_missed(
    theta_i: float, dphi: float, start: float, end: float, cone: float
) -> None:
    zone = KeepOut(name="lamp", camera_to_lamp_deg=cone)
    sampled = min(
        float(camera_to_lamp_deg(theta_i, start + (end - start) * n / 400, dphi))
        for n in range(401)
    )
    met = enters_zone(zone, Pose(theta_i, dphi, start), Pose(theta_i, dphi, end), "theta_r")
    assert met or sampled >= cone
    assert not met or sampled < cone + 0.25  # half the distance of two samples
