"""Mistakes in the camera of a rig file."""

from tests.support.config.texts import RIG, changed, problems


def test_two_mistakes_of_a_camera_are_both_reported() -> None:
    rig = changed(RIG, "axis_row_px: 160.0", "axis_row_px: 320")
    rig = changed(rig, "black_level_dn: 64.0", "black_level_dn: 4000.0")
    assert [p.split(":")[1] for p in problems(rig=rig)] == ["24", "30"]
