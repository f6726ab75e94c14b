"""Frame filter: no frame that began before the request, none with the old exposure."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.v4l2.frame_filter import FrameFilter

pytestmark = pytest.mark.real_time

exposures = st.floats(1e-4, 5.0)


def sensor(
    changes: list[tuple[float, float]], overhead_s: float, phase_s: float, delay_frames: int
) -> list[tuple[float, float]]:
    """Start and exposure of each frame of a free-running sensor.

    `changes`: time and value of each exposure set. It takes effect `delay_frames` frames late.
    """
    frames: list[tuple[float, float]] = []
    start_s, pipeline = phase_s, [changes[0][1]] * delay_frames
    while len(frames) < 40:
        pipeline.append([exposure for at_s, exposure in changes if at_s <= start_s][-1])
        exposure_s = pipeline.pop(0)
        frames.append((start_s, exposure_s))
        start_s += exposure_s + overhead_s
    return frames


@given(
    old_s=exposures,
    new_s=exposures,
    overhead_s=st.floats(1e-3, 0.2),
    changed_s=st.floats(0.0, 8.0),
    waited_s=st.floats(0.0, 3.0),
    delay_frames=st.integers(0, 3),
    stamp_at_end=st.booleans(),
)
def test_accepted_frames_began_after_the_request_at_the_new_exposure(
    old_s: float,
    new_s: float,
    overhead_s: float,
    changed_s: float,
    waited_s: float,
    delay_frames: int,
    stamp_at_end: bool,
) -> None:
    frame_filter = FrameFilter(old_s, overhead_s, delay_frames, None)
    frames = sensor([(-9.0, old_s), (changed_s, new_s)], overhead_s, -3.0, delay_frames)
    called_s = changed_s + waited_s
    frame_filter.exposure_changed(changed_s, new_s)
    frame_filter.request(called_s)
    longest_s = frame_filter.longest_exposure_s
    assert longest_s == max(old_s, new_s)
    for start_s, exposure_s in frames:
        stamp_s = start_s + (exposure_s + overhead_s if stamp_at_end else 0.0)
        if frame_filter.accepts(stamp_s):
            assert start_s >= called_s - 1e-9
            assert exposure_s == new_s
            assert frame_filter.longest_exposure_s == new_s


def test_few_frames_are_rejected_needlessly() -> None:
    """Steady camera, stamps at the end: at most two frames after the first that began later."""
    frame_filter = FrameFilter(0.01, 0.03, 2, None)
    frame_filter.request(0.0)
    stamps = [frame_filter.accepts(0.03 * n + 0.005) for n in range(10)]
    assert stamps.index(True) <= 4 + 0
    frame_filter.request(1.0)
    assert [frame_filter.accepts(1.0 + 0.03 * n) for n in range(4)] == [False, False, True, True]


def test_an_unchanged_exposure_costs_no_frames() -> None:
    frame_filter = FrameFilter(0.01, 0.005, 0, None)
    frame_filter.request(1.0)
    assert not frame_filter.accepts(1.014)
    assert frame_filter.accepts(1.016)


@pytest.mark.parametrize("late", [0, 2])
def test_without_comparable_time_stamps_frames_are_counted(late: int) -> None:
    frame_filter = FrameFilter(0.01, 0.005, late, 6)
    frame_filter.request(0.0)
    assert [frame_filter.accepts(0.0) for _ in range(10)].index(True) == 6 + late
    frame_filter.request(0.0)
    assert [frame_filter.accepts(0.0) for _ in range(10)].index(True) == 6
    frame_filter.exposure_changed(0.0, 0.02)
    frame_filter.request(0.0)
    assert [frame_filter.accepts(0.0) for _ in range(10)].index(True) == 6 + late
