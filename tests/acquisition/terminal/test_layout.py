"""Layout of tables and paragraphs: at any width, no number is cut and no line is too long."""

from __future__ import annotations

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from acquisition.terminal.layout import note_lines, table_lines, text_table_lines, wrapped
from analysis.models import MODELS
from analysis.report.style import format_value

WIDTH = st.integers(40, 200)
NAMES = st.lists(st.sampled_from(list(MODELS)), min_size=1, max_size=3, unique=True).map("+".join)
FLOATS = st.floats(allow_nan=False, allow_infinity=False)
CELLS = st.one_of(st.just(""), FLOATS.map("{:.3g}".format), st.integers(0, 10**6).map(str))
CANDIDATES = st.lists(st.tuples(NAMES, CELLS, CELLS, CELLS), min_size=1, max_size=9)
VALUES = st.builds(
    lambda value, u, unit: format_value(value, abs(u), unit),
    FLOATS,
    FLOATS,
    st.sampled_from(["", "1/sr", "°", "wavelengths"]),
)
TEXTS = st.lists(
    st.tuples(st.text("abc", min_size=1, max_size=30), st.text("xy 1", max_size=99)), min_size=1
)


@given(CANDIDATES, WIDTH)
def test_a_table_of_candidates_holds_every_number_whole(
    rows: list[tuple[str, ...]], width: int
) -> None:
    marked = [(f"→ {name}", *cells) for name, *cells in rows]
    lines = table_lines(("  candidate", "K", "χ/dof", "ΔBIC"), marked, width, indent="  ")
    cells = Counter(cell for _, *cells in rows for cell in cells if cell)
    words = Counter(word for line in lines for word in line.split())
    assert {cell: words[cell] for cell in cells} == cells
    assert max(map(len, lines)) <= width


@given(st.lists(st.tuples(NAMES, VALUES), min_size=1, max_size=6), WIDTH)
def test_a_table_of_parameters_holds_every_value_beside_its_uncertainty(
    rows: list[tuple[str, str]], width: int
) -> None:
    lines = table_lines(("parameter", "value ± u"), rows, width, right=False)
    for _, value in rows:
        assert any(value.replace("\u00a0", " ") in line for line in lines)
    longest = max(len(value) for _, value in rows)
    assert max(map(len, lines)) <= max(width, longest + 4)  # a longer number stays whole


@given(
    st.lists(
        st.sampled_from(
            [
                "a",
                "longer",
                "0.123 ± 0.004 1/sr",
                "12 %",
                "< 1e-9",
                "+3.1 u",
                "-70°",
                "= 5 deg",
                "(2 u)",
            ]
        ),
        min_size=1,
        max_size=40,
    ),
    WIDTH,
)
def test_a_paragraph_keeps_its_words_and_its_quantities(parts: list[str], width: int) -> None:
    text = " ".join(parts)
    for lines in (wrapped(text, width), note_lines(text, width)):
        assert " ".join(lines).split()[-len(text.split()) :] == text.split()
        assert max(map(len, lines)) <= width
        for part in parts:
            assert any(part in line for line in lines)


def test_a_path_is_never_broken() -> None:
    path = "/data/" + 30 * "folder/"
    assert path in wrapped(f"go on with: gonio resume {path}", 40)


@given(
    st.lists(
        st.tuples(st.text("abc", min_size=1, max_size=30), st.text("xy 1", max_size=99)), min_size=1
    ),
    WIDTH,
)
def test_a_table_of_texts_wraps_beside_its_names(rows: list[tuple[str, str]], width: int) -> None:
    lines = text_table_lines(rows, width)
    assert sum(len(line.split()) for line in lines) == sum(
        1 + len(text.split()) for _, text in rows
    )


def test_names_wrap_first_then_rows_become_paragraphs() -> None:
    def found(width: int) -> list[str]:
        return table_lines(("name", "K", "rms"), [("lambert+ggx", "5", "0.1 %")], width)[-2:]

    assert found(22) == ["─" * 21, "lambert+ggx  5  0.1 %"]
    assert found(18) == ["lambert+  5  0.1 %", "ggx"]
    assert found(17) == ["    K 5", "    rms 0.1 %"]


def test_an_empty_column_is_left_out() -> None:
    found = table_lines(("name", "χ²", "rms"), [("a", "", "1"), ("b", "", "2")], 40)
    assert found[0].split() == ["name", "rms"]
