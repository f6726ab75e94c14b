"""Header of a CSV table: missing, duplicate and badly separated columns."""

from __future__ import annotations

import pytest

from tests.support.analysis.csv_texts import BARE, HEADER, PLAIN, assert_mistake, changed, problems

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


def test_a_missing_column_is_reported_with_the_names_found() -> None:
    """A comma too many in the header also makes both rows too short."""
    found = problems(changed(BARE, "dphi_deg", "phi,"))
    assert [line[: len("data.csv:2:16")] for line in found[1:]] == [
        "data.csv:2:16",
        "data.csv:3:13",
    ]
    assert all(": row: 4 fields; allowed: 5" in line for line in found[1:])
    assert found[0] == (
        "data.csv:1:1: dphi_deg: the column is missing; found: theta_i_deg, theta_r_deg, phi, '', "
        f"brdf; allowed: {HEADER}"
    )


def test_missing_columns_are_all_named() -> None:
    found = problems("theta_i_deg,\x1b[31m\n30,\n")
    assert [line.split(":")[3] for line in found] == [" theta_r_deg", " dphi_deg", " brdf"]
    assert all(r"found: theta_i_deg, '\x1b[31m'; allowed:" in line for line in found)
    wide = ",".join(f"c{n}" for n in range(30))
    assert "c18, c19, ...; allowed" in problems(wide)[0]


def test_a_line_of_commas_alone_is_refused_at_once() -> None:
    assert problems("," * 1_000_000) == ("data.csv:1:1: header: 1000001 columns; allowed: 1000",)
    (found,) = problems(BARE + "," * 1_000_000)
    assert found.startswith("data.csv:4:5: row: 1000001 fields; allowed: 4, as in the header")
