"""Loading protocols with their rigs: what comes back, which files are read, what is told."""

import os
from pathlib import Path

import pytest
import yaml

from instrument.config.axes import HandAxis
from instrument.config.load import MAX_REPORTED, Loaded, load_protocol, load_rig
from instrument.config.protocol import Protocol, Steps
from instrument.errors import InputError

RIG = """\
name: small
beam_length_mm: 800.0
lamp_distance_mm: 1000
source_solid_angle_sr: 0.0005
receiver_solid_angle_sr: 0.0003
axes:
  theta_i: {driver: hand, min_deg: 0.0, max_deg: 80.0, u_deg: 0.1}
  dphi: {driver: hand, min_deg: 0.0, max_deg: 180.0, u_deg: 0.1}
  theta_r:
    driver: simulated
    min_deg: -88.0
    max_deg: 88.0
    speed_deg_per_s: 20.0
    acceleration_deg_per_s2: 40.0
    settle_s: 0.3
    u_deg: 0.02
keep_out:
  - {name: post, theta_r_deg: [-90.0, -87.0]}
camera:
  driver: simulated
  width_px: 640
  height_px: 320
  field_width_mm: 72.0
  axis_row_px: 160.0
  axis_column_px: 320.0
  bit_depth: 12
  full_well_electrons: 30000.0
  read_noise_electrons: 8.0
  dark_current_electrons_per_s: 20.0
  black_level_dn: 64.0
  min_exposure_s: 0.0005
  max_exposure_s: 2.0
  frame_overhead_s: 0.02
lamp: {driver: simulated, darkened_by: shutter, white_electrons_per_s: 600000.0}
"""

PROTOCOL = """\
name: foam
rig: rig.yaml
sample: {name: foam, width_mm: 50.0, height_mm: 50.0}
sweeps:
  - theta_i_deg: [30, 45.0, 60.0]
    dphi_deg: [0.0]
    theta_r_deg: {start: -80.0, stop: 80.0, num: 33}
window: {width_mm: 20.0, height_mm: 20.0}
frames_per_point: 4
exposure_target: 0.7
references:
  white_tile: {reflectance: 0.99, u_reflectance: 0.005, theta_r_deg: 10.0}
  drift_check: {theta_r_deg: 10.0, every_points: 25}
fit:
  models: [lambert, oren_nayar]
simulated_sample:
  model: oren_nayar
  parameters: {albedo: 0.8, sigma_deg: 20}
"""


def check_model(name: str, parameters: dict[str, float] | None) -> str | None:
    if name not in ("lambert", "oren_nayar"):
        return f"{name!r} is no model; allowed: lambert, oren_nayar"
    wrong = set(parameters or {}) - {"albedo", "sigma_deg"}
    return f"{name} has no parameter {wrong.pop()}" if wrong else None


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def load(protocol: str = PROTOCOL, rig: str = RIG) -> Loaded:
    Path("protocol.yaml").write_text(protocol)
    Path("rig.yaml").write_text(rig)
    return load_protocol(Path("protocol.yaml"), check_model=check_model)


def problems(protocol: str = PROTOCOL, rig: str = RIG) -> tuple[str, ...]:
    with pytest.raises(InputError) as caught:
        load(protocol, rig)
    return caught.value.problems


def changed(text: str, old: str, new: str) -> str:
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times"
    return text.replace(old, new)


def test_sound_files_load_with_their_texts() -> None:
    loaded = load()
    assert loaded.protocol_text == PROTOCOL
    assert loaded.rig_text == RIG
    assert (loaded.protocol_path, loaded.rig_path) == (Path("protocol.yaml"), Path("rig.yaml"))
    assert loaded.protocol.sweeps[0]["theta_i_deg"] == [30.0, 45.0, 60.0]
    assert loaded.protocol.sweeps[0]["theta_r_deg"] == Steps(start=-80.0, stop=80.0, num=33)
    assert list(loaded.protocol.sweeps[0]) == ["theta_i_deg", "dphi_deg", "theta_r_deg"]
    assert isinstance(loaded.rig.axes["theta_i"], HandAxis)
    assert loaded.rig == load_rig(Path("rig.yaml"))


def test_whole_numbers_stand_for_numbers() -> None:
    loaded = load()
    assert isinstance(loaded.rig.lamp_distance_mm, float)
    assert loaded.protocol.simulated_sample is not None
    assert isinstance(loaded.protocol.simulated_sample.parameters["sigma_deg"], float)


def test_sound_parts_are_checked_while_others_are_broken() -> None:
    protocol = changed(PROTOCOL, "60.0]", "85.0, sixty]")
    protocol = changed(protocol, "{width_mm: 20.0, height_mm: 20.0}", "{width_mm: 80.0}")
    rig = changed(RIG, "name: small", "nam: small")
    rig = changed(rig, "bit_depth: 12", "bit_depth: twelve")
    words = ["85 deg is past", "'sixty' is text", "is missing", "camera's field", "than the sample"]
    found = problems(protocol, rig)
    assert [any(w in p for p in found) for w in words] == [True] * 5
    assert [p for p in found if p.startswith("rig.yaml")] == [
        found[-2],
        "rig.yaml:26:14: camera.bit_depth: 'twelve' is text; allowed: a whole number from 8 to 16",
    ]


def test_a_default_view_angle_is_checked_too() -> None:
    rig = changed(RIG, "min_deg: -88.0", "min_deg: 5.0")
    protocol = changed(PROTOCOL, "start: -80.0", "start: 5")
    protocol = changed(protocol, "0.005, theta_r_deg: 10.0", "0.005")
    assert problems(protocol, rig) == (
        "protocol.yaml:12:15: references.white_tile.theta_r_deg: 0 deg is past the limits of axis"
        " theta_r; allowed: 5 to 88 deg (rig.yaml:10)",
    )


def test_yaml_mistakes_and_those_of_the_schema_come_together() -> None:
    protocol = changed(PROTOCOL, "name: foam\n", "name: &n foam\nname: bread\n")
    protocol = changed(protocol, "0.99", "*n")
    protocol = changed(protocol, "num: 33", "num: x")
    assert [p.split(":")[1] for p in problems(protocol)] == ["1", "2", "8", "13"]


def test_what_cannot_be_read_is_told_along_with_the_other_file() -> None:
    found = problems(changed(PROTOCOL, "0.7", "7"), RIG + "x: [")
    assert [p.split(": ")[0] for p in found] == ["protocol.yaml:10:18", "rig.yaml:35:5"]


def test_a_very_long_list_of_mistakes_is_cut_and_counted() -> None:
    protocol = changed(PROTOCOL, "[30, 45.0, 60.0]", f"[{'x, ' * 1000}]")
    found = problems(protocol)
    assert len(found) == MAX_REPORTED + 1
    assert "800 more mistakes from here on" in found[-1]


def test_a_rig_given_by_hand_overrides_the_named_one() -> None:
    Path("protocol.yaml").write_text(changed(PROTOCOL, "rig: rig.yaml", "rig: none.yaml"))
    Path("other.yaml").write_text(RIG)
    loaded = load_protocol(Path("protocol.yaml"), Path("other.yaml"))
    assert loaded.rig_path == Path("other.yaml")


def test_the_rig_is_found_from_the_protocol_not_from_here() -> None:
    for folder in ("protocols", "rigs"):
        Path(folder).mkdir()
    path = Path("protocols/protocol.yaml")
    path.write_text(changed(PROTOCOL, "rig: rig.yaml", "rig: ../rigs/rig.yaml"))
    Path("rigs/rig.yaml").write_text(RIG)
    assert load_protocol(path).rig_path == Path("rigs/rig.yaml")


def test_the_rig_is_found_behind_a_linked_folder() -> None:
    Path("far/protocols").mkdir(parents=True)
    Path("far/protocols/protocol.yaml").write_text(
        changed(PROTOCOL, "rig: rig.yaml", "rig: ../rig.yaml")
    )
    Path("far/rig.yaml").write_text(RIG)
    Path("here").symlink_to("far/protocols")
    assert load_protocol(Path("here/protocol.yaml")).rig.name == "small"


def message_of(path: Path, rig: Path | None = None) -> str:
    with pytest.raises(InputError) as caught:
        load_protocol(path, rig)
    return str(caught.value)


def test_a_missing_file_names_similar_ones() -> None:
    load()
    assert message_of(Path("protcol.yaml")) == (
        "protcol.yaml: no such file; in . there is protocol.yaml"
    )
    assert message_of(Path("x.yaml")).endswith("in . there is protocol.yaml, rig.yaml")
    assert "there is no folder none" in message_of(Path("none/x.yaml"))


def test_a_missing_rig_does_not_hide_the_protocols_mistakes() -> None:
    Path("protocol.yaml").write_text(changed(PROTOCOL, "0.7", "7"))
    first, second = message_of(Path("protocol.yaml"), Path("gone.yaml")).splitlines()
    assert first.startswith("protocol.yaml:10:18: exposure_target: 7 is too large")
    assert second.startswith("gone.yaml: no such file")


def test_a_folder_is_no_file() -> None:
    Path("configs").mkdir()
    Path("configs/a.yaml").write_text("")
    assert message_of(Path("configs")) == (
        "configs: is a folder; allowed: a YAML file; in configs there is a.yaml"
    )


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read every file")
def test_a_file_that_may_not_be_read() -> None:
    Path("secret.yaml").write_text("a: 1")
    Path("secret.yaml").chmod(0)
    assert message_of(Path("secret.yaml")).startswith("secret.yaml: cannot be read: Permission")


def test_a_name_with_control_characters_is_shown_harmless() -> None:
    assert "\x1b" not in message_of(Path("a\x1b[2J.yaml"))


def test_empty_and_odd_files() -> None:
    Path("empty.yaml").write_text("")
    assert message_of(Path("empty.yaml")).startswith("empty.yaml:1:1: the file is empty")
    Path("list.yaml").write_text("- a\n")
    assert message_of(Path("list.yaml")).startswith("list.yaml:1:1: the file is a list")
    Path("latin.yaml").write_bytes(b"name: caf\xe9\n")
    assert message_of(Path("latin.yaml")).startswith("latin.yaml:1:10: byte 0xe9 is not UTF-8")


def test_the_same_schema_guards_python_callers() -> None:
    with pytest.raises(ValueError, match="at least 3 items"):
        Protocol.model_validate({**yaml.safe_load(PROTOCOL), "sweeps": [{"dphi_deg": [0.0]}]})
