"""CSV tables of any content: what was written comes back, and nothing breaks the reader."""

from __future__ import annotations

import csv
import io
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from instrument.errors import InputError
from tests.support.csv_texts import BARE, NAMES, problems, read


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


ANGLE = st.floats(0, 90)
GEOMETRY = st.tuples(ANGLE, st.floats(-90, 90), st.floats(-720, 720))
VALUES = st.tuples(st.floats(-1e15, 1e15), st.floats(1e-15, 1e15))
# Line ends never stand in a field; a line that begins with # is a comment.
TEXT = st.text(st.characters(exclude_characters="\r\n", codec="utf-8"), max_size=8)
FURTHER = TEXT.filter(lambda text: not text.lstrip("\ufeff").startswith("#"))


@given(data=st.data(), end=st.sampled_from(["\n", "\r\n"]), mark=st.sampled_from(["", "\ufeff"]))
def test_a_table_comes_back_as_it_was_written(data: st.DataObject, end: str, mark: str) -> None:
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
def test_no_text_breaks_the_reader(rest: str) -> None:
    for text in (rest, BARE + rest):
        found: tuple[str, ...] = ()
        try:
            read(text)
        except InputError as error:
            found = error.problems
        assert all(line.startswith(("data.csv:", "... and ")) for line in found)


def test_many_rows_are_read_quickly() -> None:
    count = 50_000
    rows = (f"{n % 90},{n / count},0,0.25,0.001,9876,0.02,4,,x" for n in range(count))
    text = "\n".join(["theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf,a,b,c,d,e", *rows])
    start = time.perf_counter()
    m = read(text)
    took = time.perf_counter() - start
    assert m.size == count
    assert took / count < 100e-6  # some 6e-6 s a row on a quiet machine; this notices a blunder


def test_a_line_of_commas_alone_is_refused_at_once() -> None:
    assert problems("," * 1_000_000) == ("data.csv:1:1: header: 1000001 columns; allowed: 1000",)
    (found,) = problems(BARE + "," * 1_000_000)
    assert found.startswith("data.csv:4:5: row: 1000001 fields; allowed: 4, as in the header")
