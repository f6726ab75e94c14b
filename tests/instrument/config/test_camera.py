"""Mistakes in the camera of a rig file."""

import pytest

from tests.support.config.texts import RIG, changed, problems


def test_two_mistakes_of_a_camera_are_both_reported() -> None:
    rig = changed(RIG, "axis_row_px: 160.0", "axis_row_px: 320")
    rig = changed(rig, "black_level_dn: 64.0", "black_level_dn: 4000.0")
    assert [p.split(":")[1] for p in problems(rig=rig)] == ["24", "30"]


@pytest.mark.parametrize(
    ("pixel_format", "bit_depth", "allowed"),
    [("GREY", 12, "8"), ("YUYV", 10, "8"), ("Y10", 12, "10"), ("Y16", 8, "9 to 16")],
)
def test_a_bit_depth_that_the_pixel_format_does_not_have_is_refused(
    pixel_format: str, bit_depth: int, allowed: str
) -> None:
    driver = f"camera:\n  driver: v4l2\n  device: /dev/video0\n  pixel_format: {pixel_format}"
    rig = changed(RIG, "camera:\n  driver: simulated", driver)
    rig = changed(rig, "bit_depth: 12", f"bit_depth: {bit_depth}")
    expected = f"camera.bit_depth: {bit_depth}; allowed for {pixel_format}: {allowed}"
    assert any(p.endswith(expected) for p in problems(rig=rig))
