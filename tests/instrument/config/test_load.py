"""Loading protocols with their rigs: which files are read, what is returned, what is reported."""

import re
from pathlib import Path

import pytest

from instrument.config.axes import HandAxis
from instrument.config.load import MAX_REPORTED, load_protocol, load_rig
from instrument.config.protocol import Steps
from instrument.errors import InputError
from tests.support.config.mistakes import CHECK_MISTAKES, PROTOCOL_MISTAKES, RIG_MISTAKES
from tests.support.config.texts import PROTOCOL, RIG, changed, load, problems


def test_valid_files_load_with_their_texts() -> None:
    loaded = load()
    assert loaded.protocol_text == PROTOCOL
    assert loaded.rig_text == RIG
    assert (loaded.protocol_path, loaded.rig_path) == (Path("protocol.yaml"), Path("rig.yaml"))
    assert loaded.protocol.sweeps[0]["theta_i_deg"] == [30.0, 45.0, 60.0]
    assert loaded.protocol.sweeps[0]["theta_r_deg"] == Steps(start=-80.0, stop=80.0, num=33)
    assert list(loaded.protocol.sweeps[0]) == ["theta_i_deg", "dphi_deg", "theta_r_deg"]
    assert isinstance(loaded.rig.axes["theta_i"], HandAxis)
    assert loaded.rig == load_rig(Path("rig.yaml"))


def test_whole_numbers_are_accepted_as_floats() -> None:
    loaded = load()
    assert isinstance(loaded.rig.lamp_distance_mm, float)
    assert loaded.protocol.simulated_sample is not None
    assert isinstance(loaded.protocol.simulated_sample.parameters["sigma_deg"], float)


def test_valid_parts_are_checked_although_others_are_not_valid() -> None:
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


def test_mistakes_of_yaml_and_of_the_schema_are_reported_together() -> None:
    protocol = changed(PROTOCOL, "name: foam\n", "name: &n foam\nname: bread\n")
    protocol = changed(protocol, "0.99", "*n")
    protocol = changed(protocol, "num: 33", "num: x")
    assert [p.split(":")[1] for p in problems(protocol)] == ["1", "2", "8", "13"]


def test_a_file_that_cannot_be_read_does_not_hide_mistakes_of_the_other() -> None:
    found = problems(changed(PROTOCOL, "0.7", "7"), RIG + "x: [")
    assert [p.split(": ")[0] for p in found] == ["protocol.yaml:10:18", "rig.yaml:35:5"]


def test_a_very_long_list_of_mistakes_is_cut_and_counted() -> None:
    protocol = changed(PROTOCOL, "[30, 45.0, 60.0]", f"[{'x, ' * 1000}]")
    found = problems(protocol)
    assert len(found) == MAX_REPORTED + 1
    assert "800 more mistakes from here on" in found[-1]


@pytest.mark.parametrize(
    ("old", "new", "given", "words"),
    [
        ("0.7", "0.7\nkeep_frames: yes", "yes", "allowed: true or false (write true)"),
        ("0.7", "0.7\nkeep_frames: 'off'", "'off'", "allowed: true or false (write false)"),
        (
            "target: 0.7",
            "target: 70%",
            "70%",
            "and less than 1 (write 0.7, not in %)",
        ),
        ("nce: 0.005", "nce: 0.5 %", "0.5 %", "a number, at least 0 (write 0.005, not in %)"),
        (
            "{width_mm: 20.0",
            "{width_mm: 20 mm",
            "20 mm",
            "(write 20: the unit is in the key's name)",
        ),
        ("[30, 45.0", "[30°, 45.0", "30°", "(write 30: the unit is in the key's name)"),
    ],
)
def test_a_value_in_an_everyday_form_is_answered_with_the_one_to_write(
    old: str, new: str, given: str, words: str
) -> None:
    """The advised value is accepted in its place."""
    (found,) = problems(changed(PROTOCOL, old, new))
    assert found.endswith(words)
    (advised,) = re.findall(r"write ([0-9.]+|true|false)", words)
    load(changed(PROTOCOL, old, new.replace(given, advised)))


def test_no_value_is_advised_where_none_can_be_known() -> None:
    (found,) = problems(changed(PROTOCOL, "0.7", "0.7\nkeep_frames: maybe"))
    assert found.endswith("'maybe' is text; allowed: true or false")
    (found,) = problems(changed(PROTOCOL, "{width_mm: 20.0", "{width_mm: 40 %"))
    assert found.endswith("greater than 0 (write it in the unit of the key)")


def test_a_rig_given_by_hand_overrides_the_named_one() -> None:
    Path("protocol.yaml").write_text(changed(PROTOCOL, "rig: rig.yaml", "rig: none.yaml"))
    Path("other.yaml").write_text(RIG)
    loaded = load_protocol(Path("protocol.yaml"), Path("other.yaml"))
    assert loaded.rig_path == Path("other.yaml")


def test_the_rig_is_found_relative_to_the_protocol() -> None:
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


def test_a_missing_rig_does_not_hide_the_protocols_mistakes() -> None:
    Path("protocol.yaml").write_text(changed(PROTOCOL, "0.7", "7"))
    first, second = message_of(Path("protocol.yaml"), Path("gone.yaml")).splitlines()
    assert first.startswith("protocol.yaml:10:18: exposure_target: 7 is too large")
    assert second.startswith("gone.yaml: no such file")


def test_many_mistakes_at_once_in_order_of_file_and_line() -> None:
    protocol, rig = PROTOCOL, RIG
    lines = []
    for kind in ("empty text", "too small", "incidence past the axis", "num 0", "octal"):
        old, new, message = (PROTOCOL_MISTAKES | CHECK_MISTAKES)[kind]
        protocol = changed(protocol, old, new)
        lines.append(f"protocol.yaml:{message}")
    for kind in ("too large", "drift check past the axis", "unknown model", "not finite"):
        old, new, message = (PROTOCOL_MISTAKES | CHECK_MISTAKES)[kind]
        protocol = changed(protocol, old, new)
        lines.append(f"protocol.yaml:{message}")
    for kind in ("limits swapped", "range of one", "exposures swapped"):
        old, new, message = RIG_MISTAKES[kind]
        rig = changed(rig, old, new)
        lines.append(f"rig.yaml:{message}")
    assert list(problems(protocol, rig)) == lines


def test_empty_and_odd_files() -> None:
    Path("empty.yaml").write_text("")
    assert message_of(Path("empty.yaml")).startswith("empty.yaml:1:1: the file is empty")
    Path("list.yaml").write_text("- a\n")
    assert message_of(Path("list.yaml")).startswith("list.yaml:1:1: the file is a list")
    Path("latin.yaml").write_bytes(b"name: caf\xe9\n")
    assert message_of(Path("latin.yaml")).startswith("latin.yaml:1:10: byte 0xe9 is not UTF-8")


WITH_TABLE = changed(PROTOCOL, "reflectance: 0.99, u_reflectance: 0.005", "table: tiles/white.csv")
WITH_TRUE_TILE = RIG + "simulation: {tile: {at_normal: 1.05, falloff: 0.2}}\n"


def write_table(beta: str = "1.03") -> Path:
    path = Path("tiles/white.csv")
    path.parent.mkdir(exist_ok=True)
    header = "theta_i_deg,theta_r_deg,dphi_deg,beta,u_beta"
    path.write_text(f"{header}\n0,10,0,1.05,0.003\n60,10,0,{beta},0.003\n")
    return path


def test_a_white_tile_s_table_is_beside_the_protocol_and_may_be_replaced() -> None:
    path = write_table()
    loaded = load(WITH_TABLE, WITH_TRUE_TILE)
    assert loaded.tile_text == path.read_text()
    tile = loaded.protocol.references.white_tile
    assert tile is not None
    assert tile.values is not None
    assert tile.values.at(30.0, 10.0, 0.0).beta == pytest.approx(1.04)
    path.rename("copy.csv")
    again = load_protocol(Path("protocol.yaml"), tile_path=Path("copy.csv"))
    assert again.protocol == loaded.protocol
    assert load().tile_text is None


def test_a_missing_table_is_a_mistake_of_the_protocol() -> None:
    place = "protocol.yaml:12:23: references.white_tile.table"
    assert problems(WITH_TABLE, WITH_TRUE_TILE) == (
        f"{place}: tiles/white.csv: no such file; check its name and folder",
    )


def test_mistakes_in_a_table_are_reported_beside_those_of_the_protocol() -> None:
    write_table(beta="103")
    wrong = changed(WITH_TABLE, "[lambert, oren_nayar]", "[lambertian]")
    first, second = problems(wrong, WITH_TRUE_TILE)
    assert first.startswith("protocol.yaml:15:12: fit.models[0]: 'lambertian' is no model")
    assert second == "tiles/white.csv:3:9: beta: 103; allowed: 0.001 to 5, not in %"


def test_a_table_stands_in_place_of_a_number() -> None:
    write_table()
    both = changed(WITH_TABLE, "table: tiles", "reflectance: 0.9, certificate: 0/45, table: tiles")
    assert problems(both, WITH_TRUE_TILE) == (
        "protocol.yaml:12:29: references.white_tile.reflectance: 0.9 beside a table; allowed: one "
        "of the two",
        "protocol.yaml:12:47: references.white_tile.certificate: 0/45 beside a table; allowed: one "
        "of the two",
    )


def test_a_simulated_rig_must_know_the_true_tile() -> None:
    """A certificate says what somebody measured; a scene shows what is there."""
    write_table()
    text = "the rig rig.yaml is simulated; allowed: with simulation: tile in it, the true tile"
    assert problems(WITH_TABLE) == (f"protocol.yaml:12:23: references.white_tile.table: {text}",)
    one = changed(PROTOCOL, "reflectance: 0.99", "certificate: 0/45, reflectance: 1.01")
    load(one, WITH_TRUE_TILE)
    assert [p.endswith(text) for p in problems(one)] == [True]


def test_a_reflectance_above_1_is_that_of_a_direction() -> None:
    above = changed(
        PROTOCOL, "reflectance: 0.99", "certificate: 8/hemispherical, reflectance: 1.01"
    )
    assert problems(above, WITH_TRUE_TILE) == (
        "protocol.yaml:12:59: references.white_tile.reflectance: 1.01; allowed: at most 1 "
        "(0/45 or 45/0: 2)",
    )
