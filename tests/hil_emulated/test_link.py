"""Calls to the bench: results, errors that belong to the caller, several callers."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.hil_emulated.link import ADDRESS, Bench, BenchServer


class Calculator:
    def quotient(self, a: float, b: float) -> float:
        return a / b


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    with BenchServer(Calculator()) as server:
        monkeypatch.setenv(ADDRESS, f"127.0.0.1:{server.port}")
        yield Bench.connected()


def test_a_call_returns_its_result_or_raises_its_error(bench: Bench) -> None:
    assert bench.quotient(6, b=3) == 2
    with pytest.raises(RuntimeError, match="ZeroDivisionError"):
        bench.quotient(1, 0)
    assert Bench.connected().quotient(1, 4) == 0.25
    assert bench.quotient(9, 3) == 3
