"""Mistakes in the camera of a rig file."""

import pytest

from instrument.config.camera import V4l2CameraConfig
from tests.support.config.texts import PROTOCOL, RIG, changed, load, problems


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


YUYV = "camera:\n  driver: v4l2\n  device: /dev/video0\n  pixel_format: YUYV\n  luma_range: limited"


@pytest.mark.parametrize(
    ("pixel_format", "black_level", "message"),
    [
        ("YUYV", 20.0, ""),
        ("YUYV", 8.0, "camera.black_level_dn: 8; allowed with luma_range limited: at least 16"),
        ("GREY", 20.0, "camera.luma_range: limited; allowed for GREY: full"),
    ],
)
def test_a_limited_range_is_for_yuyv_and_has_its_black_at_16(
    pixel_format: str, black_level: float, message: str
) -> None:
    rig = changed(RIG, "camera:\n  driver: simulated", YUYV.replace("YUYV", pixel_format))
    rig = changed(rig, "bit_depth: 12", "bit_depth: 8")
    rig = changed(rig, "black_level_dn: 64.0", f"black_level_dn: {black_level}")
    rig = changed(rig, "read_noise_electrons: 8.0", "read_noise_electrons: 80.0")
    found = [p for p in problems(rig=rig) if "camera." in p]
    assert [p.split(": ", 1)[1] for p in found] == ([message] if message else [])


def test_full_scale_of_the_limited_range_is_235() -> None:
    camera = {
        "driver": "v4l2", "device": "/dev/video0", "pixel_format": "YUYV", "width_px": 64,
        "height_px": 48, "field_width_mm": 72.0, "axis_row_px": 24.0, "axis_column_px": 32.0,
        "bit_depth": 8, "full_well_electrons": 10_000.0, "read_noise_electrons": 8.0,
        "dark_current_electrons_per_s": 20.0, "black_level_dn": 16.0, "min_exposure_s": 0.001,
        "max_exposure_s": 0.1, "frame_overhead_s": 0.01,
    }  # fmt: skip
    full, limited = (
        V4l2CameraConfig.model_validate({**camera, "luma_range": luma}) for luma in
        ("full", "limited")
    )  # fmt: skip
    assert (full.max_dn, limited.max_dn) == (255, 235)
    assert limited.electrons_per_dn == pytest.approx(10_000 / (235 - 16))


def test_a_hot_pixel_outside_the_image_is_refused() -> None:
    """The image has 320 rows and 640 columns."""
    pixel = "{{row: {}, column: {}, electrons_per_s: 100.0}}"
    pixels = ", ".join(pixel.format(*at) for at in ((319, 639), (320, 1), (1, 640)))
    rig = RIG + f"simulation: {{camera_defects: {{hot_pixels: [{pixels}]}}}}\n"
    found = problems(rig=rig)
    assert len(found) == 2
    for place in ("row 320, column 1", "row 1, column 640"):
        text = f"hot pixel in {place}; allowed: rows up to 319, columns up to 639"
        assert any(problem.endswith(text) for problem in found)


def with_dark_patch(x_mm: float) -> str:
    """Rig file with a dark patch 8 mm wide beside the sample, which reaches to 25 mm."""
    patch = f"{{x_mm: {x_mm}, y_mm: 0.0, width_mm: 8.0, height_mm: 8.0, reflectance: 0.001, "
    return changed(
        RIG, "  bit_depth: 12", f"  dark_patch: {patch}u_reflectance: 0.0}}\n  bit_depth: 12"
    )


def test_a_dark_patch_must_lie_in_the_picture_and_beside_the_sample() -> None:
    """The picture is 72 mm wide."""
    load(rig=with_dark_patch(30.0))
    (outside,) = problems(rig=with_dark_patch(-33.0))
    assert outside.startswith("rig.yaml:26:15: camera.dark_patch: from -37 to -29 mm leaves the")
    assert "allowed: -36.1 to 35.9 mm" in outside
    (twice,) = problems(rig=with_dark_patch(30.0) + "uncertainty: {stray_light: 0.01}\n")
    assert "stray_light 0.01, u_stray_light 0; allowed with a dark_patch of the camera" in twice
    (covered,) = problems(rig=with_dark_patch(28.0))
    assert covered.startswith("protocol.yaml:3:32: sample.width_mm: 50 mm; allowed: at most 48 mm")
    assert "dark patch is covered (rig.yaml:26)" in covered


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "  bit_depth: 12",
            "  bit_depth: 12\n  channels: 3\n  calibration: camera.npz",
            "camera.calibration: camera.npz with channels 3; allowed: none, as it is of one",
        ),
        (
            "  bit_depth: 12",
            "  bit_depth: 12\n  channels: 2",
            "camera.channels: 2 is none of these; allowed: 1 or 3",
        ),
        (
            "lamp:",
            "simulation: {channel_responses: [0.5, 1.0, 0.7]}\nlamp:",
            "simulation: channel_responses beside a camera of one channel; allowed: with channels:",
        ),
    ],
)
def test_what_cannot_work_in_colour_is_refused(old: str, new: str, message: str) -> None:
    found = problems(rig=changed(RIG, old, new))
    assert any(message in p for p in found), found


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "20}",
            "20}\n  channel_albedos: [0.8, 1.2, 0.1]",
            "channel_albedos[1]: 1.2 is too large; allowed",
        ),
        (
            "  parameters: {albedo: 0.8, sigma_deg: 20}",
            "  parameters: {sigma_deg: 20}\n  channel_albedos: [0.8, 0.2, 0.1]",
            "simulated_sample.channel_albedos: beside parameters without an albedo; allowed",
        ),
        (
            "20}",
            "20}\n  variation: {pattern: halves, parameters: {sigma_deg: 5},"
            " channel_albedos: [0.8, 0.2, 0.1]}",
            "simulated_sample.channel_albedos: is missing of the sample; allowed: of both or",
        ),
    ],
)
def test_albedos_of_channels_that_make_no_sample_are_refused(
    old: str, new: str, message: str
) -> None:
    found = problems(changed(PROTOCOL, old, new))
    assert any(message in p for p in found), found


@pytest.mark.parametrize(("pixel_format", "given", "allowed"), [("YUYV", 3, 1), ("BGR3", 1, 3)])
def test_the_channels_are_those_of_the_pixel_format(
    pixel_format: str, given: int, allowed: int
) -> None:
    full = YUYV.replace("YUYV", pixel_format).replace("limited", "full")
    rig = changed(RIG, "camera:\n  driver: simulated", full)
    rig = changed(rig, "bit_depth: 12", f"bit_depth: 8\n  channels: {given}")
    text = f"camera.channels: {given}; allowed for {pixel_format}: {allowed}"
    assert any(text in p for p in problems(rig=rig))
