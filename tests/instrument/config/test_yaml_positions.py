"""YAML data with positions: accepted words, refused features, hints."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from instrument.config.yaml_positions import (
    MAX_BYTES,
    MAX_DEPTH,
    Mark,
    MarkedYaml,
    dotted,
    number_hint,
    read_yaml,
)


def read(text: str) -> MarkedYaml:
    return read_yaml(text.encode())


def mistakes(text: str) -> list[tuple[int, int, str]]:
    return [(m.mark.line, m.mark.column, m.text) for m in read(text).mistakes]


def only_mistake(text: str) -> tuple[int, int, str]:
    (found,) = mistakes(text)
    return found


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("true", True),
        ("false", False),
        ("null", None),
        ("~", None),
        ("", None),
        ("0", 0),
        ("-12", -12),
        ("+3", 3),
        ("0.5", 0.5),
        ("5.", 5.0),
        (".5", 0.5),
        ("-5.0e-3", -0.005),
        ("5.0E+3", 5000.0),
        (".inf", math.inf),
        ("-.inf", -math.inf),
    ],
)
def test_plain_words_with_a_meaning(word: str, value: object) -> None:
    got = read(f"a: {word}\n").data["a"]
    assert got == value
    assert type(got) is type(value)


@pytest.mark.parametrize(
    "word",
    [
        *["yes", "no", "on", "off", "Yes", "True", "TRUE", "False", "NULL", "=", ".Inf", ".NaN"],
        *["5e-3", "5.0e3", "1:30", "1_000", "1_0.5", "010", "0x1F", "0b11", "0o17", "12mm", "٣"],
        *["2024-01-01", "2024-01-01T10:00:00Z", "1.5.2"],
    ],
)
def test_all_other_words_are_text(word: str) -> None:
    marked = read(f"a: {word}\n")
    assert marked.data == {"a": word}
    assert not marked.mistakes


def test_quoted_words_are_text() -> None:
    assert read("a: '5'\nb: \"true\"\nc: ''\n").data == {"a": "5", "b": "true", "c": ""}


@pytest.mark.parametrize("digits", [101, 5000])
def test_a_number_too_long_for_any_purpose_is_text(digits: int) -> None:
    assert read(f"a: {'1' * digits}\n").data == {"a": "1" * digits}


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("5e-3", "write 5.0e-3"),
        ("1e5", "write 1.0e+5"),
        ("5.0e3", "write 5.0e+3"),
        ("1_000", "write 1000"),
        ("010", "write 10"),
        ("-010", "write -10"),
        ("1,5", "write 1.5"),
        ("0x1F", "write 31"),
        ("5", "write 5, without quotes"),
        ("1:30", "write one number, in the unit that the key names, without a colon"),
        ("12 mm", "write 12: the unit is in the key's name"),
        ("30°", "write 30: the unit is in the key's name"),
        ("sixty", None),
        ("1.5.2", None),
        ("", None),
        ("-", None),
        ("true", None),
    ],
)
def test_number_hint(text: str, hint: str | None) -> None:
    assert number_hint(text) == hint


@pytest.mark.parametrize(
    ("text", "in_key", "without"),
    [
        ("70%", "write it in the unit of the key", "write 0.7, not in %"),
        ("0,5 %", "write it in the unit of the key", "write 0.005, not in %"),
        ("-3 %", "write it in the unit of the key", "write -0.03, not in %"),
        ("12 mm", "write 12: the unit is in the key's name", "write 12, without mm"),
    ],
)
def test_number_hint_with_a_unit(text: str, in_key: str, without: str) -> None:
    assert number_hint(text) == in_key
    assert number_hint(text, unit_in_key=False) == without


def test_number_hint_for_a_whole_number() -> None:
    assert number_hint("1e5", whole=True) == "write 100000"


def test_positions_of_keys_and_values() -> None:
    marked = read("# head\na: 1\nb:\n  - {c: x,  d: [10, 20]}\n")
    assert marked.values[("a",)] == Mark(2, 4)
    assert marked.keys[("b",)] == Mark(3, 1)
    assert marked.keys[("b", 0, "d")] == Mark(4, 13)
    assert marked.values[("b", 0, "d", 1)] == Mark(4, 21)
    assert marked.mark(("b", 0, "nothing", "here")) == Mark(4, 5)


def test_a_value_by_path() -> None:
    marked = read("a: [{b: 7}]\n")
    assert marked.get(("a", 0, "b")) == 7
    assert [marked.get(path) for path in (("a", 1), ("a", "b"), ("a", 0, "b", "c"))] == [None] * 3


def test_keys_are_always_text() -> None:
    assert read("1: a\ntrue: b\n~: c\n").data == {"1": "a", "true": "b", "~": "c"}


def test_every_duplicate_key_is_reported_and_the_first_kept() -> None:
    text = "a: 1\nb: 2\na: 3\nc: {d: 1, d: 2}\na: 4\n"
    assert mistakes(text) == [
        (3, 1, "duplicate key, first at line 1, column 1; keep one of them"),
        (4, 11, "duplicate key, first at line 4, column 5; keep one of them"),
        (5, 1, "duplicate key, first at line 1, column 1; keep one of them"),
    ]
    assert read(text).data == {"a": 1, "b": 2, "c": {"d": 1}}


@pytest.mark.parametrize(
    ("text", "line", "column", "words"),
    [
        ("a: &x 1\n", 1, 4, "anchor &x"),
        ("a: &x 1\nb: *x\n", 2, 4, "alias *x"),
        ("a: 1\n<<: {b: 2}\n", 2, 1, "merge key <<"),
        ("a: !!float 5\n", 1, 4, "tag 'tag:yaml.org,2002:float'"),
        ("a: !mine {b: 1}\n", 1, 4, "tag '!mine'"),
        ("a: !!python/object/apply:os.system [ls]\n", 1, 4, "tag"),
        ("? [a, b]\n: 1\n", 1, 3, "a key must be one word"),
        ("a: 1\n---\nb: 2\n", 2, 1, "a second document"),
        ("a: [1, 2\nb: 3\n", 2, 2, "comma or a closing bracket"),
        ("a: 1\n\tb: 2\n", 2, 1, "never with tabs"),
        ("a: b: c\n", 1, 5, "one colon too many"),
        ("a: 1\n b: 2\n", 2, 3, "one colon too many, or a wrong indent"),
        ('a: "\\ud800"\n', 1, 4, "half a character"),
        ("a: 1\nb: \x07\n", 2, 4, "character"),
    ],
)
def test_a_refused_feature_is_reported_with_its_position(
    text: str, line: int, column: int, words: str
) -> None:
    found = mistakes(text)
    assert any((at, col) == (line, column) and words in what for at, col, what in found), found


def test_several_mistakes_are_collected() -> None:
    text = "a: &x 1\nb: *x\nb: 2\nc: !t 3\nd: [\n"
    assert [line for line, _, _ in mistakes(text)] == [1, 2, 3, 4, 6]


def test_nested_aliases_are_not_expanded() -> None:
    rows = ["a: &a [l, l, l, l]"]
    rows += [
        f"{b}: &{b} [*{a}, *{a}, *{a}, *{a}]" for a, b in zip("abcdefg", "bcdefgh", strict=True)
    ]
    marked = read("\n".join(rows))
    assert marked.data["h"] == [None] * 4
    assert len(marked.mistakes) == 8 + 7 * 4  # each anchor and each alias


@pytest.mark.parametrize("text", ["", "# nothing\n", "---\n", "--- ~\n"])
def test_an_empty_file(text: str) -> None:
    assert only_mistake(text)[2].startswith("the file is empty; allowed: a block")


@pytest.mark.parametrize(
    ("text", "kind"), [("- a\n- b\n", "a list"), ("word\n", "text"), ("\n 5\n", "a number")]
)
def test_a_file_that_is_no_block(text: str, kind: str) -> None:
    assert f"the file is {kind}; allowed: a block" in only_mistake(text)[2]
    assert not read(text).readable


def test_not_utf_8() -> None:
    (mistake,) = read_yaml("a: 1\nb: dé\n".encode("latin-1")).mistakes
    assert mistake.mark == Mark(2, 5)
    assert "byte 0xe9 is not UTF-8" in mistake.text


def test_a_byte_order_mark_is_no_part_of_the_text() -> None:
    assert read_yaml(b"\xef\xbb\xbfa: 1\n").data == {"a": 1}


def test_too_large() -> None:
    (mistake,) = read_yaml(b"#" * (MAX_BYTES + 1)).mistakes
    assert mistake.text == "the file is too large; allowed: 256 kB"


@pytest.mark.parametrize("opening", ["[", "{a: ", "- "])
def test_too_deep(opening: str) -> None:
    assert f"allowed: {MAX_DEPTH} levels" in mistakes("a:\n " + opening * 20_000)[-1][2]


def test_too_deep_inside_a_key() -> None:
    first, second = mistakes("? " * 20_000)
    assert first == (1, 3, "a key must be one word, not a block, a list or an alias")
    assert f"allowed: {MAX_DEPTH} levels" in second[2]


def test_deep_enough() -> None:
    depth = MAX_DEPTH - 1
    assert not mistakes("a: " + "[" * depth + "]" * depth)


def test_dotted_paths() -> None:
    path = ("sweeps", 0, "theta_r_deg", "num")
    assert dotted(path) == "sweeps[0].theta_r_deg.num"
    assert dotted(("a b", "\x1b[2J")) == r"'a b'.'\x1b[2J'"


_YAML_SIGNS = st.text(alphabet="ab01.:-_ \n\t[]{},&*!|>?'\"#%@<=~e+\\\u2028é\x00", max_size=60)


@settings(max_examples=300, deadline=None)
@given(_YAML_SIGNS)
def test_any_text_is_read_or_has_a_mistake(text: str) -> None:
    marked = read(text)
    assert marked.readable or marked.mistakes
    assert all(m.mark.line >= 1 and m.mark.column >= 1 for m in marked.mistakes)


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=60))
def test_any_bytes_are_read_or_have_a_mistake(raw: bytes) -> None:
    marked = read_yaml(raw)
    assert marked.readable or marked.mistakes


@settings(max_examples=200, deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_float_that_python_prints_is_read_or_hinted_at(value: float) -> None:
    word = repr(value)
    got = read(f"a: {word}\n").data["a"]
    if isinstance(got, str):  # Python prints 1e-05 and 1e+16, without a point
        hint = number_hint(got)
        assert hint is not None
        got = read(f"a: {hint.removeprefix('write ')}\n").data["a"]
    assert got == value
