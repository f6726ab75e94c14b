"""Every kind of mistake in a rig file, and many mistakes at once."""

from pathlib import Path

import pytest

from instrument.config.load import load_rig
from instrument.errors import InputError
from tests.instrument.config.test_load import PROTOCOL, RIG, changed, problems
from tests.instrument.config.test_protocol import PROTOCOL_MISTAKES


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


DRIVERS = "hand or newport or oriental or simulated or zaber"

RIG_MISTAKES = {
    "driver missing": (
        "dphi: {driver: hand, ",
        "dphi: {",
        "8:9: axes.dphi.driver: is missing; allowed: " + DRIVERS,
    ),
    "driver unknown": (
        "dphi: {driver: hand",
        "dphi: {driver: hands",
        "8:18: axes.dphi.driver: 'hands' is none of these; allowed: "
        + DRIVERS
        + " (did you mean hand?)",
    ),
    "no axis": (
        "dphi: {driver: hand, min_deg: 0.0, max_deg: 180.0, u_deg: 0.1}",
        "dphi: 4",
        "8:9: axes.dphi: 4 is a number; allowed: a block with driver: " + DRIVERS,
    ),
    "key of another driver": (
        "max_deg: 180.0",
        "settle_s: 1.0, max_deg: 180.0",
        "8:38: axes.dphi.settle_s: unknown key; did you mean set_s? allowed: min_deg, max_deg,"
        " zero_deg, sign, u_deg, driver, set_s",
    ),
    "key called like the driver": (
        "max_deg: 180.0",
        "hand: 1.0, max_deg: 180.0",
        "8:38: axes.dphi.hand: unknown key; allowed: min_deg, max_deg,"
        " zero_deg, sign, u_deg, driver, set_s",
    ),
    "sign": (
        "max_deg: 180.0",
        "sign: 2, max_deg: 180.0",
        "8:44: axes.dphi.sign: 2 is none of these; allowed: 1 or -1",
    ),
    "limits swapped": (
        "max_deg: 180.0",
        "max_deg: -5",
        "8:33: axes.dphi.min_deg: 0; allowed: less than max_deg -5",
    ),
    "range of one": (
        "[-90.0, -87.0]",
        "[-90.0]",
        "18:31: keep_out[0].theta_r_deg: a list of 1 is too short; allowed: a list of 2 numbers",
    ),
    "range swapped": (
        "[-90.0, -87.0]",
        "[-87.0, -90.0]",
        "18:31: keep_out[0].theta_r_deg: [-87, -90]; allowed: [low, high]",
    ),
    "box and cone": (
        "[-90.0, -87.0]",
        "[-90.0, -87.0], camera_to_lamp_deg: 4",
        "18:12: keep_out[0].name: 'post' is both a box and a cone; allowed: either some of"
        " theta_i_deg, dphi_deg, theta_r_deg, or camera_to_lamp_deg",
    ),
    "exposures swapped": (
        "max_exposure_s: 2.0",
        "max_exposure_s: 1.0e-4",
        "31:19: camera.min_exposure_s: 0.0005; allowed: at most max_exposure_s 0.0001",
    ),
    "axis outside the picture": (
        "axis_row_px: 160.0",
        "axis_row_px: 320",
        "24:16: camera.axis_row_px: 320 lies outside the picture; allowed: 0 to 319",
    ),
    "list for a block": (
        "lamp: {driver: simulated, darkened_by: shutter, white_electrons_per_s: 600000.0}",
        "lamp: [1]",
        "34:7: lamp: a list stands here; allowed: a block with driver, darkened_by, shutter_s,"
        " cover_s, white_electrons_per_s",
    ),
}


@pytest.mark.parametrize("kind", RIG_MISTAKES)
def test_a_mistake_in_the_rig(kind: str) -> None:
    old, new, message = RIG_MISTAKES[kind]
    rig = changed(RIG, old, new)
    assert problems(rig=rig) == (f"rig.yaml:{message}",)
    with pytest.raises(InputError) as caught:
        load_rig(Path("rig.yaml"))
    assert caught.value.problems == (f"rig.yaml:{message}",)


def test_two_mistakes_of_a_camera_are_both_told() -> None:
    rig = changed(RIG, "axis_row_px: 160.0", "axis_row_px: 320")
    rig = changed(rig, "black_level_dn: 64.0", "black_level_dn: 4000.0")
    assert [p.split(":")[1] for p in problems(rig=rig)] == ["24", "30"]


def test_many_mistakes_at_once_in_order_of_file_and_line() -> None:
    protocol, rig = PROTOCOL, RIG
    lines = []
    for kind in ("empty text", "too small", "incidence past the axis", "num 0", "octal"):
        old, new, message = PROTOCOL_MISTAKES[kind]
        protocol = changed(protocol, old, new)
        lines.append(f"protocol.yaml:{message}")
    for kind in ("too large", "drift check past the axis", "unknown model", "not finite"):
        old, new, message = PROTOCOL_MISTAKES[kind]
        protocol = changed(protocol, old, new)
        lines.append(f"protocol.yaml:{message}")
    for kind in ("limits swapped", "range of one", "exposures swapped"):
        old, new, message = RIG_MISTAKES[kind]
        rig = changed(rig, old, new)
        lines.append(f"rig.yaml:{message}")
    assert list(problems(protocol, rig)) == lines
