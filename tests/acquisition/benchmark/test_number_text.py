"""Numbers as text."""

from __future__ import annotations

from acquisition.benchmark.number_text import percent, rounded, short


def test_numbers_as_a_reader_writes_them() -> None:
    assert [short(x) for x in (0, 0.02, 3.0, 1000, 1e4, 2e-4, 9.96e-7)] == [
        "0", "0.02", "3", "1000", "10⁴", "2·10⁻⁴", "10⁻⁶",
    ]  # fmt: skip
    assert [rounded(x) for x in (0.1234, 12.6, 1234.4)] == ["0.12", "13", "1234"]
    assert percent(0.0123) == "1.2 %"
