"""Machine of a benchmark: every fact has a value."""

from __future__ import annotations

from acquisition.benchmark.machine import machine


def test_processor_system_and_versions_are_stated() -> None:
    facts = machine()
    assert {"processor", "cores", "system", "Python", "gonio", "numpy", "date"} <= set(facts)
    assert all(facts.values())
