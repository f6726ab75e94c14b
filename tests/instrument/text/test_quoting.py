"""Values from outside appear in error messages in one printable line."""

from __future__ import annotations

import pytest

from instrument.text.quoting import printable, shown


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "true"), (None, "nothing"), (5, "5"), (0.5, "0.5"), ("a\x1b", "'a\\x1b'"),
        ("x" * 50, "'" + "x" * 40 + "...'"), ([1, 2], "a list of 2"), ({}, "a block of keys"),
    ],
)  # fmt: skip
def test_a_value_is_shown_as_yaml_writes_it(value: object, text: str) -> None:
    assert shown(value) == text


def test_a_name_is_quoted_only_if_it_is_not_printable() -> None:
    assert printable("größe 1.yaml") == "größe 1.yaml"
    assert printable("a\nb") == "'a\\nb'"
