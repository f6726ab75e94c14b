"""Random protocols, rigs and keep-out zones, and moves followed through the zones step by step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from hypothesis import strategies as st

from acquisition.plan.moves import Move
from acquisition.plan.pose import Pose
from instrument.config.axes import AXES
from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import DriftCheck, References, WhiteTile
from instrument.config.rig import KeepOut, Rig
from instrument.geometry import camera_to_lamp_deg
from tests.support.paths import CONFIGS
from tests.support.scans import changed

SAMPLES = 41  # poses checked on the path of a move


@cache
def base(rig: str) -> Loaded:
    """Return the demonstration protocol on a rig file of configs."""
    return load_protocol(CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / f"{rig}.yaml")


def angles(low: int, high: int, most: int) -> st.SearchStrategy[list[float]]:
    """Different angles in any order, in steps of half a degree."""
    halves = st.lists(st.integers(2 * low, 2 * high), min_size=1, max_size=most, unique=True)
    return halves.map(lambda found: [n / 2 for n in found])


def ranges(low: int, high: int) -> st.SearchStrategy[list[float]]:
    """Ranges of up to 12 degrees that begin between `low` and `high`."""
    pair = st.tuples(st.integers(low, high), st.integers(0, 12))
    return pair.map(lambda ends: [float(ends[0]), float(ends[0] + ends[1])])


ZONES = st.one_of(
    st.builds(KeepOut, name=st.just("post"), theta_r_deg=ranges(-88, 76)),
    st.builds(KeepOut, name=st.just("arm"), theta_i_deg=ranges(0, 73), theta_r_deg=ranges(-88, 76)),
    st.builds(KeepOut, name=st.just("cable"), dphi_deg=ranges(0, 168), theta_r_deg=ranges(0, 76)),
    st.builds(KeepOut, name=st.just("lamp"), camera_to_lamp_deg=st.floats(0.5, 12.0)),
)


@st.composite
def scans(draw: st.DrawFn) -> Loaded:
    """Any protocol of up to two sweeps, on a rig with motors or with a lamp that is set by hand."""
    loaded = base(draw(st.sampled_from(["bench_12bit", "paper_1995"])))
    views = draw(angles(-87, 87, 9))
    cut = draw(st.integers(1, len(views)))  # two sweeps share no view angle
    sweeps = []
    for part in (views[:cut], views[cut:]):
        written: list[tuple[str, Any]] = [
            ("theta_i_deg", draw(angles(1, 84, 3))),
            ("dphi_deg", draw(angles(0, 180, 3))),
            ("theta_r_deg", part),
        ]
        sweeps.append(dict(draw(st.permutations(written))))
    reference_deg = st.integers(-60, 60).map(float)
    tile = draw(
        st.none()
        | st.builds(
            WhiteTile, reflectance=st.just(0.99), u_reflectance=st.just(0.005),
            theta_r_deg=reference_deg, again_at_end=st.booleans(),
        )
    )  # fmt: skip
    drift = draw(
        st.none() | st.builds(DriftCheck, theta_r_deg=reference_deg, every_points=st.integers(1, 6))
    )
    return changed(
        loaded,
        rig={
            "keep_out": draw(st.lists(ZONES, max_size=2)),
            "blocked_half_angle_deg": draw(st.none() | st.floats(0.5, 15.0)),
        },
        sweeps=[sweep for sweep in sweeps if sweep["theta_r_deg"]],
        references=References(white_tile=tile, drift_check=drift),
    )


def separation_deg(pose: Pose) -> float:
    """Return the angle between the directions of camera and lamp."""
    return float(camera_to_lamp_deg(pose.theta_i, pose.theta_r, pose.dphi))


def follow(pose: Pose, moves: Sequence[Move], rig: Rig) -> Pose:
    """Return the pose after the moves; assert that all of the path is within limits and clear."""
    for move in moves:
        axis = rig.axes[move.axis]
        assert axis.min_deg - 1e-9 <= move.angle_deg <= axis.max_deg + 1e-9
        for there in _path(pose, move):
            assert not any(_inside(zone, there) for zone in rig.keep_out)
        pose = pose._replace(**{move.axis: move.angle_deg})
    return pose


def _path(pose: Pose, move: Move) -> list[Pose]:
    """Return poses from one end of a move to the other, or the end if the start is unknown."""
    start_deg = getattr(pose, move.axis)
    if math.isnan(start_deg):
        return [pose._replace(**{move.axis: move.angle_deg})]
    return [
        pose._replace(**{move.axis: float(angle_deg)})
        for angle_deg in np.linspace(start_deg, move.angle_deg, SAMPLES)
    ]


def _inside(zone: KeepOut, pose: Pose) -> bool:
    """Return True if a zone forbids a pose; none forbids a pose with an unknown angle."""
    if zone.camera_to_lamp_deg is not None:
        return separation_deg(pose) < zone.camera_to_lamp_deg - 1e-9
    limits = {name: getattr(zone, f"{name}_deg") for name in AXES}
    return all(
        pair is None or pair[0] <= getattr(pose, name) <= pair[1] for name, pair in limits.items()
    )
