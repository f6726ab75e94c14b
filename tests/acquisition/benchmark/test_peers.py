"""Other programs: one that is missing or does not work becomes a line of the page."""

from __future__ import annotations

import pytest

from acquisition.benchmark.peers import is_usable, lambertian_peers, peer_lines


def test_a_missing_peer_is_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.benchmark.peers.find_spec", dict[str, object]().get)
    assert not is_usable("lmfit")
    assert lambertian_peers(0.5) == {}
    lines = peer_lines().values()
    assert len(lines) == 3
    assert all("not installed" in line and "pip install" in line for line in lines)


def test_a_peer_that_does_not_work_is_a_line_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.benchmark.peers.find_spec", lambda module: module)
    lines = peer_lines()
    assert "lmfit" in lines["lmfit"]
    for name in ("pySCATMECH", "Mitsuba"):
        if "of unknown version" in lines[name]:  # not really there
            assert "does not work here, not compared: ModuleNotFoundError" in lines[name]
            assert not is_usable(name)
