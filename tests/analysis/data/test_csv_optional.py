"""Optional columns of a table: shared errors, lamp settings, acceptance; mistakes by position."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.data.acceptance import Acceptance
from analysis.data.csv.table import CsvTable, read_table
from instrument.errors import InputError
from tests.support.analysis.csv_texts import problems

ANGLES = ("theta_i_deg", "theta_r_deg", "dphi_deg", "brdf")
ACCEPTANCE = {
    "beam_length_mm": 1800.0, "lamp_distance_mm": 1500.0, "source_solid_angle_sr": 0.003,
    "receiver_solid_angle_sr": 0.0009, "patch_width_mm": 20.0, "patch_height_mm": 10.0,
}  # fmt: skip


def text(size: int, **further: object) -> str:
    """Table of `size` rows; a further column has one value for all rows, or a list."""
    columns = [[30] * size, list(range(size)), [0] * size, [0.2] * size]
    columns += [v if isinstance(v, list) else [v] * size for v in further.values()]
    rows = (",".join(map(str, row)) for row in zip(*columns, strict=True))
    return "\n".join((",".join((*ANGLES, *further)), *rows))


def table(size: int, **further: object) -> CsvTable:
    Path("data.csv").write_text(text(size, **further))
    return read_table(Path("data.csv"))


def test_a_plain_table_states_nothing_more() -> None:
    found = table(2, u_brdf=0.01)
    assert (found.acceptance, found.flagged, found.states_shared) == (None, 0, False)
    assert found.measurements.shared == ()


def test_errors_that_rows_share() -> None:
    m = table(
        3, u_brdf=0.01, u_shared_white_tile_relative=0.005,
        u_shared_drift_1_relative=[0, 0.1, -0.2], group_drift_1=[1, 1, 2],
        u_shared_drift_2_relative=["", "", ""],
    ).measurements  # fmt: skip
    tile, drift = m.shared
    assert (tile.name, tile.u_relative.tolist(), tile.group.tolist()) == (
        "white tile", [0.005] * 3, [0, 0, 0],
    )  # fmt: skip
    assert (drift.name, drift.u_relative.tolist(), drift.group.tolist()) == (
        "drift", [0.0, 0.1, -0.2], [0, 0, 1],
    )  # fmt: skip


def test_independent_u_is_relative_and_goes_before_u_brdf() -> None:
    found = table(2, u_brdf=0.1, u_independent_relative=[0.01, 0.02])
    assert found.measurements.u_random is not None
    np.testing.assert_allclose(found.measurements.u_random, [0.002, 0.004])
    assert found.states_shared


def test_the_turn_of_theta_r_during_each_row() -> None:
    found = table(2, u_brdf=0.01, blur_deg=[0.5, 0.25]).measurements
    assert np.array_equal(found.blur_deg, [0.5, 0.25])
    assert np.array_equal(found.subset(np.array([False, True])).blur_deg, [0.25])
    assert not np.any(table(2, u_brdf=0.01).measurements.blur_deg)


def test_a_turn_beyond_the_horizon_is_a_mistake_of_its_row() -> None:
    Path("data.csv").write_text(
        "theta_i_deg,theta_r_deg,dphi_deg,brdf,blur_deg\n30,0,0,0.2,5\n30,-89,0,0.2,2.5\n"
    )
    with pytest.raises(InputError) as caught:
        read_table(Path("data.csv"))
    allowed = "allowed: 2 deg or less about -89 deg"
    assert f"data.csv:3:14: blur_deg: 2.5 deg; {allowed}" in str(caught.value)


def test_lamp_settings_acceptance_and_u_of_angles() -> None:
    u_deg = {"u_theta_i_deg": 0.1, "u_theta_r_deg": 0.02, "u_dphi_deg": 0.3}
    found = table(2, u_brdf=0.01, lamp_setting=[4, 2], **ACCEPTANCE, **u_deg)
    assert found.acceptance == Acceptance(**ACCEPTANCE)
    m = found.measurements
    assert (m.u_theta_i_deg, m.u_theta_r_deg, m.u_dphi_deg) == (0.1, 0.02, 0.3)
    assert m.lamp_setting.tolist() == [3, 1]


MISTAKES = {
    "text": ({"lamp_setting": [1, "x"]}, "3:12: lamp_setting: 'x' is text; allowed: a whole"),
    "fraction": ({"lamp_setting": [1, 1.5]}, "3:12: lamp_setting: 1.5; allowed: a whole number"),
    "empty in one row": (
        {"u_brdf": 1, "u_theta_r_deg": [1, ""]},
        "3:14: u_theta_r_deg: is empty here, but not in every row; allowed: 0",
    ),
    "not constant": (
        {"u_brdf": 1, "u_dphi_deg": [1, 2]},
        "3:14: u_dphi_deg: 2 deg; allowed: 1 deg, as in line 2: one for all rows",
    ),
    "angles without noise": ({"u_dphi_deg": 1}, "1:39: u_dphi_deg: is stated; allowed: with"),
    "negative u": (
        {"u_independent_relative": [1, -1]}, "3:12: u_independent_relative: -1; allowed: 1e-15",
    ),
    "part of the acceptance": ({"patch_width_mm": 1}, "1:1: beam_length_mm: missing or empty"),
    "solid angle": (
        ACCEPTANCE | {"source_solid_angle_sr": 3}, "2:26: source_solid_angle_sr: 3 sr; allowed: 0",
    ),
    "twice": ({"flags": "", "flags ": ""}, "1:45: flags: duplicate column, first at column 39"),
}  # fmt: skip


@pytest.mark.parametrize("kind", MISTAKES)
def test_a_mistake_is_reported_with_its_position(kind: str) -> None:
    further, message = MISTAKES[kind]
    assert problems(text(2, **further))[0].startswith(f"data.csv:{message}")


def test_a_relative_u_of_zero_is_refused() -> None:
    wrong = text(1, u_independent_relative=0.1).replace("0.2,", "0,")
    assert problems(wrong) == (
        "data.csv:2:10: u_independent_relative: of 0 is 0; allowed: 1e-15 or more; state u_brdf",
    )


CELL = st.one_of(st.just(""), st.floats(), st.integers(-3, 3), st.text("1.e-x ", max_size=4))
NAMES = st.sampled_from(
    (
        *("flags", "radiance", "lamp_setting", "u_brdf", "u_independent_relative", "u_dphi_deg"),
        *("u_shared_a_relative", "group_a", "u_shared__1_relative", *ACCEPTANCE),
    )
)


@given(st.dictionaries(NAMES, st.lists(CELL, min_size=3, max_size=3)), st.booleans())
def test_any_cells_are_read_or_reported(further: dict[str, list[object]], blank: bool) -> None:
    content = text(3, **further).replace("0.2", "" if blank else "0.2")
    Path("data.csv").write_text(content)
    reported: tuple[str, ...] = ()
    try:
        found = read_table(Path("data.csv"))
        assert found.measurements.size + found.flagged == 3
    except InputError as error:
        reported = error.problems
    # The first mistakes are listed with their positions; the last line may count the others.
    assert all(line.startswith(("data.csv:", "... and ")) for line in reported)
