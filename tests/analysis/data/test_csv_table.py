"""CSV tables: read back as written; mistakes are named with their position."""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from instrument.errors import InputError
from tests.support.analysis.csv_texts import (
    BARE,
    NAMES,
    PLAIN,
    assert_mistake,
    problems,
    read,
)


def test_a_plain_table() -> None:
    m = read(PLAIN)
    assert m.theta_i_deg.tolist() == [30, 30]
    assert m.theta_r_deg.tolist() == [-20.5, 10]  # with its sign
    assert m.dphi_deg.tolist() == [0, 0]
    assert m.brdf.tolist() == [0.25, -0.001]  # noise about zero is data
    assert m.u_random is not None
    assert m.u_random.tolist() == [0.002, 0.002]
    assert m.lamp_setting.tolist() == [0, 0]
    assert m.shared == ()


def test_u_brdf_is_stated_for_all_rows_or_for_none() -> None:
    assert read(BARE).u_random is None
    assert read(PLAIN.replace("0.002", " ")).u_random is None


# Equivalent notations of BARE.
SAME = {
    "byte order mark": "\ufeff" + BARE,
    "CRLF": BARE.replace("\n", "\r\n"),
    "CR": BARE.replace("\n", "\r"),
    "no end of the last line": BARE[:-1],
    "blank lines and comments": "# plaster\n\n" + BARE.replace("\n", "\n#, a note\n  \n"),
    "quotes and spaces": BARE.replace("30,", '"30", ').replace("brdf", ' "brdf" '),
    "further columns": BARE.replace("\n", ',"5"" disc, matte"\n'),
    "double further columns": BARE.replace("\n", ",,\n"),
    "exponents": BARE.replace("30,", "+3.0E1,").replace("0.25", ".25"),
}


@pytest.mark.parametrize("kind", SAME)
def test_equivalent_notations_of_a_table(kind: str) -> None:
    m, expected = read(SAME[kind]), read(BARE)
    for name in ("theta_i_deg", "theta_r_deg", "dphi_deg", "brdf"):
        np.testing.assert_array_equal(getattr(m, name), getattr(expected, name))


def test_the_measurements_of_a_run() -> None:
    """Columns of a run's own table; flagged rows are left out, whatever they hold."""
    header = "theta_i_deg,theta_r_deg,dphi_deg,radiance,u_radiance,brdf,u_brdf,window_pixels"
    m = read(
        f"{header},exposure_s,frames,flags,time_utc,u_noise_relative\n"
        "30.0,-20.0,0.0,812.5,1.6,0.231,0.0011,9876.00,0.02,4,,2024-05-04T10:00:00Z,0.001\n"
        '30.0,0.0,0.0,790.1,1.6,,,9876.00,0.02,4,"saturated; small",,0.001\n'
    )
    assert m.brdf.tolist() == [0.231]
    assert m.theta_r_deg.tolist() == [-20.0]
    assert not m.relative


def test_a_table_of_flagged_rows_alone_has_no_rows_to_fit() -> None:
    m = read("theta_i_deg,theta_r_deg,dphi_deg,brdf,flags\n30,0,0,.2,dark\n30,10,0,,dark\n")
    assert m.size == 0


def test_one_direction_by_other_angles_is_another_setting() -> None:
    rows = ["30,0,0,.2", "30,0,90,.2", "30,-20,0,.2", "30,20,180,.2", "0,20,0,.2", "0,20,90,.2"]
    m = read("\n".join(["theta_i_deg,theta_r_deg,dphi_deg,brdf", *rows]))
    assert m.size == 6
    assert len(set(m.lamp_setting.tolist())) == 5  # two of them at (30, 0)


# Table, text to replace, replacement, and the whole message, with positions counted by hand.
MISTAKES = {
    "text": (
        PLAIN,
        "0.25",
        "dark",
        "2:12: brdf: 'dark' is text; allowed: -1e15 to 1e15 1/sr",
    ),
    "long text": (
        PLAIN,
        "0.25",
        "x" * 99,
        f"2:12: brdf: '{'x' * 40}...' is text; allowed: -1e15 to 1e15 1/sr",
    ),
    "underscore": (
        PLAIN,
        "0.25",
        "1_0",
        "2:12: brdf: '1_0' is text; allowed: -1e15 to 1e15 1/sr",
    ),
    "decimal comma in quotes": (
        PLAIN,
        "-20.5",
        '"-20,5"',
        "2:4: theta_r_deg: '-20,5' is text; allowed: a number from -90 to 90 deg (write -20.5)",
    ),
    "typographic minus": (
        PLAIN,
        "-20.5",
        "−20.5",
        "2:4: theta_r_deg: '−20.5' is text; allowed: a number from -90 to 90 deg (write -20.5)",
    ),
    "unit in the field": (
        PLAIN,
        "-20.5",
        "-20.5°",
        "2:4: theta_r_deg: '-20.5°' is text; allowed: a number from -90 to 90 deg (write -20.5)",
    ),
    "decimal comma without quotes": (
        PLAIN,
        "0.25",
        "0,25",
        "2:17: row: 6 fields; allowed: 5, as in the header (line 1)"
        " (decimal numbers take a point; text with a comma needs quotes)",
    ),
    "nan": (PLAIN, "0.25", "nan", "2:12: brdf: 'nan' is not finite; allowed: -1e15 to"),
    "infinite": (PLAIN, "0.25", "-inf", "2:12: brdf: '-inf' is not finite; allowed: -1e15 to"),
    "overflow": (PLAIN, "0.25", "1e999", "2:12: brdf: '1e999' is not finite; allowed: -1e15 to"),
    "azimuth not finite": (
        PLAIN,
        "-20.5,0",
        "-20.5,inf",
        "2:10: dphi_deg: 'inf' is not finite; allowed: a finite number of deg",
    ),
    "empty angle": (
        PLAIN,
        "-20.5",
        "",
        "2:4: theta_r_deg: is empty; allowed: a number from -90 to 90 deg",
    ),
    "blank angle": (
        PLAIN,
        "-20.5",
        "  ",
        "2:4: theta_r_deg: is empty; allowed: a number from -90 to 90 deg",
    ),
    "brdf empty in one row": (
        PLAIN,
        "0.25",
        "",
        "2:12: brdf: is empty here, but not in every row; allowed: -1e15 to 1e15 1/sr",
    ),
    "u_brdf empty in one row": (
        PLAIN,
        "0.25,0.002",
        "0.25,",
        "2:17: u_brdf: is empty here, but not in every row; allowed: 1e-15 to 1e15 1/sr",
    ),
    "u_brdf zero": (
        PLAIN,
        "0.25,0.002",
        "0.25,0.0",
        "2:17: u_brdf: 0.0 1/sr; allowed: 1e-15 to 1e15 1/sr",
    ),
    "u_brdf negative": (
        PLAIN,
        "0.25,0.002",
        "0.25,-2e-3",
        "2:17: u_brdf: -2e-3 1/sr; allowed: 1e-15 to 1e15 1/sr",
    ),
    "incidence past 90": (
        PLAIN,
        "30,-20.5",
        "90.0001,-20.5",
        "2:1: theta_i_deg: 90.0001 deg; allowed: a number from 0 to 90 deg",
    ),
    "incidence below 0": (
        PLAIN,
        "30,-20.5",
        "-30,-20.5",
        "2:1: theta_i_deg: -30 deg; allowed: a number from 0 to 90 deg",
    ),
    "view past -90": (
        PLAIN,
        "-20.5",
        "-91",
        "2:4: theta_r_deg: -91 deg; allowed: a number from -90 to 90 deg",
    ),
    "view past 90": (
        PLAIN,
        "-20.5",
        "90.5",
        "2:4: theta_r_deg: 90.5 deg; allowed: a number from -90 to 90 deg",
    ),
    "too few fields": (
        PLAIN,
        ",0.25,0.002",
        "",
        "2:11: row: 3 fields; allowed: 5, as in the header (line 1)",
    ),
    "one field": (
        BARE,
        "30,10,0,0.24",
        "the end",
        "3:8: row: 1 field; allowed: 4, as in the header (line 1)",
    ),
    "semicolons in one row": (
        BARE,
        "30,10,0,0.24",
        "30;10;0;0,24",
        "3:13: row: 2 fields; allowed: 4, as in the header (line 1)"
        " (separate fields by commas, not by ';')",
    ),
    "too many fields": (
        BARE,
        "0.24",
        "0.24,",
        "3:14: row: 5 fields; allowed: 4, as in the header (line 1)"
        " (decimal numbers take a point; text with a comma needs quotes)",
    ),
    "the same geometry": (
        BARE,
        "30,10,0,0.24",
        " 3e1,-20.50,-0,0.24",
        "3:2: theta_i_deg: the same three angles as in line 2; allowed: each geometry once;"
        " average repeats with their u",
    ),
}


@pytest.mark.parametrize("kind", MISTAKES)
def test_a_mistake_in_a_row_is_reported_with_its_position(kind: str) -> None:
    assert_mistake(*MISTAKES[kind])


def test_an_empty_brdf_in_every_row_has_its_own_message() -> None:
    header = "theta_i_deg,theta_r_deg,dphi_deg,power,brdf,u_brdf\n"
    assert problems(header + "30,0,0,812.5,,\n30,10,0,790.1, ,\n") == (
        "data.csv:1:40: brdf: is empty in every row: no reference was taken, so there is no BRDF"
        " to fit; allowed: a scan with a white tile, or a column radiance",
    )


def test_radiance_alone_is_read_relative_to_the_level_of_each_lamp_setting() -> None:
    header = "theta_i_deg,theta_r_deg,dphi_deg,radiance,brdf,u_brdf\n"
    m = read(header + "60,0,0,812.5,,\n60,10,0,790.1, ,\n")
    assert (m.relative, m.free_levels) == (True, True)
    np.testing.assert_allclose(m.brdf, [1625.0, 1580.2])  # over cos 60 degrees


def test_radiance_and_brdf_are_not_both_empty() -> None:
    assert problems("theta_i_deg,theta_r_deg,dphi_deg,radiance,brdf\n60,0,0,,\n") == (
        "data.csv:1:43: brdf: is empty in every row, and so is radiance; allowed: one of them",
    )


def test_all_mistakes_are_reported_at_once_by_position() -> None:
    found = problems(
        "theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf,brdf\n"
        "95,91,x,.2,0,\n"
        "30,0\n"
        "\n"
        "30,0,0,,1,\n"
        "30,0,0,.2,1,\n"
        '30,0,"0,.2,1,\n'
    )
    starts = [":".join(line.split(":")[:4]) for line in found]
    assert starts == [
        "data.csv:1:46: brdf",
        "data.csv:2:1: theta_i_deg",
        "data.csv:2:4: theta_r_deg",
        "data.csv:2:7: dphi_deg",
        "data.csv:2:12: u_brdf",
        "data.csv:3:5: row",
        "data.csv:5:8: brdf",
        "data.csv:6:1: theta_i_deg",
        "data.csv:7:6: row",
    ]
    assert "as in line 5; allowed: each geometry once; average repeats" in found[-2]


ANGLE = st.floats(0, 90)
GEOMETRY = st.tuples(ANGLE, st.floats(-90, 90), st.floats(-720, 720))
VALUES = st.tuples(st.floats(-1e15, 1e15), st.floats(1e-15, 1e15))
# A field holds no line end; a line that begins with # is a comment.
TEXT = st.text(st.characters(exclude_characters="\r\n", codec="utf-8"), max_size=8)
FURTHER = TEXT.filter(lambda text: not text.lstrip("\ufeff").startswith("#"))


@given(data=st.data(), end=st.sampled_from(["\n", "\r\n"]), mark=st.sampled_from(["", "\ufeff"]))
def test_a_table_is_read_back_as_written(data: st.DataObject, end: str, mark: str) -> None:
    geometries = data.draw(st.lists(GEOMETRY, min_size=1, max_size=6, unique=True))
    rows = [(*geometry, *data.draw(VALUES)) for geometry in geometries]
    further = data.draw(
        st.lists(FURTHER.filter(lambda name: name.strip() not in NAMES), max_size=3)
    )
    names = NAMES[: data.draw(st.sampled_from([4, 5]))]
    order = data.draw(st.permutations(range(len(names) + len(further))))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator=end)
    for row in (names, *rows):
        values = [*map(str, row[: len(names)]), *(data.draw(FURTHER) for _ in further)]
        values = [*names, *further] if row is names else values
        writer.writerow([values[n] for n in order])
    m = read(mark + text.getvalue())
    expected = np.array(rows).T
    found = (m.theta_i_deg, m.theta_r_deg, m.dphi_deg, m.brdf)
    np.testing.assert_array_equal(found, expected[:4])
    if len(names) == 4:
        assert m.u_random is None
    else:
        np.testing.assert_array_equal(m.u_random, expected[4])


@given(st.text(st.sampled_from('theta_ir_deg,dphi\n\r\t;#"0123456789.-e x'), max_size=80))
def test_no_text_crashes_the_reader(rest: str) -> None:
    for text in (rest, BARE + rest):
        found: tuple[str, ...] = ()
        try:
            read(text)
        except InputError as error:
            found = error.problems
        assert all(line.startswith(("data.csv:", "... and ")) for line in found)


def test_many_rows_are_read_quickly(record_property: Callable[[str, object], None]) -> None:
    """At about 20 MB/s; with all its checks in a few times the time of NumPy's reader alone."""
    count = 50_000
    rows = [f"{n % 90},{n / count},0,0.25,0.001,9876,0.02,4,,x" for n in range(count)]
    header = "theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf,a,b,c,d,e"
    text = "\n".join([header, *rows])
    own_s, numpy_s = [], []
    for _ in range(3):
        start_s = time.process_time()
        m = read(text)
        read_s = time.process_time()
        alone = np.loadtxt(rows, delimiter=",", usecols=range(5))
        own_s.append(read_s - start_s)
        numpy_s.append(time.process_time() - read_s)
    assert m.size == count
    assert np.array_equal(m.theta_r_deg, alone[:, 1])
    record_property("speed", f"{len(text) / min(own_s) / 1e6:.0f} MB/s")
    assert min(own_s) < 10 * min(numpy_s)


@pytest.mark.parametrize("seed", range(8))
def test_a_mistake_in_a_long_table_is_named_where_it_is(seed: int) -> None:
    draw = np.random.default_rng(seed)
    rows = [[f"{n % 60}", f"{n / 10 - 30:g}", "0", "0.25", "1e-3"] for n in range(500)]
    row, column = int(draw.integers(2, 500)), int(draw.integers(5))
    rows[row][column] = str(draw.choice(["", "1_0", "nan", "x", "1e999", "0x1"]))
    if draw.random() < 0.5:
        rows[int(draw.integers(1, 500))][2] = '"0"'
    (found,) = problems("\n".join([",".join(NAMES), *map(",".join, rows)]))
    start = len(",".join([*rows[row][:column], ""]))
    assert found.startswith(f"data.csv:{row + 2}:{start + 1}: {NAMES[column]}: ")


@pytest.mark.parametrize("first", ["[lamp]", "{}", "[1", "{a"])
def test_a_name_that_begins_like_json_makes_no_json_file(first: str) -> None:
    m = read(f"{first},{','.join(NAMES[:4])}\nx,30,10,0,0.2\n")
    assert m.brdf.tolist() == [0.2]


@pytest.mark.parametrize(
    "text",
    ['["theta_i_deg", "brdf"]', "[\n{", '{"theta_i_deg": [30], "brdf": [0.2]}', "[[30, 0.2]]"],
)
def test_json_is_named_whatever_it_holds(text: str) -> None:
    with pytest.raises(InputError, match="is a JSON file; allowed: a table as text"):
        read(text)
