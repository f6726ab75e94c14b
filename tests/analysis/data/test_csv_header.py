"""Header of a CSV table: missing, duplicate and badly separated columns."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.analysis.csv_texts import (
    BARE,
    HEADER,
    NAMES,
    PLAIN,
    assert_mistake,
    changed,
    problems,
    read,
)

# Table, text to replace, replacement, and the whole message, with positions counted by hand.
MISTAKES = {
    "column double": (
        PLAIN,
        ",u_brdf",
        ", brdf",
        "1:40: brdf: duplicate column, first at column 34; keep one of them",
    ),
    "semicolons": (
        BARE,
        BARE,
        BARE.replace(",", ";").replace(".", ","),
        "1:12: header: fields are separated by ';': use commas, and a point in decimal numbers",
    ),
    "tabs": (
        BARE,
        BARE,
        BARE.replace(",", "\t"),
        "1:12: header: fields are separated by tabs: use commas, and a point in decimal numbers",
    ),
    "spaces": (
        BARE,
        BARE,
        BARE.replace(",", " "),
        "1:12: header: fields are separated by spaces: use commas, and a point in decimal numbers",
    ),
    "header alone": (
        BARE,
        BARE[BARE.index("\n") :],
        "\n# no row\n",
        "1:1: header: no row follows; allowed: a row for each geometry",
    ),
    "nothing": (BARE, BARE, "", f"1:1: the file is empty; allowed: {HEADER}, and a row for each"),
    "blank": (BARE, BARE, "\n \n", f"1:1: the file is empty; allowed: {HEADER}, and a row for"),
}


@pytest.mark.parametrize("kind", MISTAKES)
def test_a_mistake_in_the_header_is_reported_with_its_position(kind: str) -> None:
    assert_mistake(*MISTAKES[kind])


def test_missing_columns_are_named_in_one_message_with_the_names_found() -> None:
    """The rows are not read: without its columns, a row means nothing."""
    assert problems(changed(BARE, "dphi_deg", "azimuth,")) == (
        "data.csv:1:1: header: missing: dphi_deg; found: theta_i_deg, theta_r_deg, azimuth, '', "
        f"brdf; allowed: {HEADER}",
    )
    (found,) = problems("theta_i_deg,\x1b[31m\n30,\n")
    assert r"missing: theta_r_deg, dphi_deg, brdf; found: theta_i_deg, '\x1b[31m'; allowed" in found
    wide = ",".join(f"c{n}" for n in range(30))
    assert "c18, c19, ...; allowed" in problems(wide)[0]


CASES = st.sampled_from([str.lower, str.upper, str.title, str.swapcase])
SEPARATORS = st.sampled_from(["_", " ", "-", ".", ""])
ANGLE_UNITS = st.sampled_from(["_deg", " (deg)", " [°]", " / °", "", "_Degrees"])


@given(st.data())
def test_a_name_in_another_form_is_answered_with_the_one_to_write(data: st.DataObject) -> None:
    """Never taken silently, never ignored: a U_BRDF that is ignored would change every u."""
    for name in NAMES:
        stem = name.removesuffix("_deg")
        unit = (
            data.draw(ANGLE_UNITS) if stem != name else data.draw(st.sampled_from(["", " (1/sr)"]))
        )
        other = data.draw(CASES)(stem.replace("_", data.draw(SEPARATORS))) + unit
        if other != name:
            (found,) = problems(
                PLAIN.replace(name, other, 1) if name != "brdf" else PLAIN.replace("brdf", other, 1)
            )
            assert f"write {name} for {other!r}" in found


@pytest.mark.parametrize("name", ["theta_i (rad)", "Theta_I [mrad]", "theta_i_rad"])
def test_an_angle_in_radians_is_missing(name: str) -> None:
    """A new name would not convert the values."""
    (found,) = problems(changed(BARE, "theta_i_deg", name))
    assert "missing: theta_i_deg" in found
    assert "write theta_i_deg" not in found


def test_a_header_that_stands_elsewhere_is_pointed_out() -> None:
    assert problems("# " + BARE) == (
        "data.csv:2:1: header: line 1 looks like the header: remove its #",
    )
    assert problems("Foam, dry\n\n" + BARE) == (
        "data.csv:1:1: header: line 3 looks like the header: begin the lines above it with #",
    )
    (found,) = problems(BARE.partition("\n")[2])  # none at all
    assert "missing: theta_i_deg, theta_r_deg, dphi_deg, brdf; found: 30, -20.5, 0, 0.25;" in found


def test_a_line_of_units_is_one_mistake() -> None:
    header, _, rows = BARE.partition("\n")
    assert problems(f"{header}\ndeg,deg,deg,1/sr\n{rows}") == (
        "data.csv:2:1: row: no number in it; begin a line of units or of names with #",
    )
    assert read(f"{header}\n#deg,deg,deg,1/sr\n{rows}").size == 2


def test_a_line_of_commas_alone_is_refused_at_once() -> None:
    assert problems("," * 1_000_000) == ("data.csv:1:1: header: 1000001 columns; allowed: 1000",)
    (found,) = problems(BARE + "," * 1_000_000)
    assert found.startswith("data.csv:4:5: row: 1000001 fields; allowed: 4, as in the header")
