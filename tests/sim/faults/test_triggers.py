"""Trigger points: at or after the n-th call of a method."""

from __future__ import annotations

from sim.faults.triggers import Triggers


def test_an_action_runs_once_before_or_after_the_call_it_was_planned_for() -> None:
    triggers, log = Triggers(), list[str]()
    triggers.plan("at", "camera.grab", 2, lambda: log.append("at 2"))
    triggers.plan("after", "camera.grab", 2, lambda: log.append("after 2"))
    for number in (1, 2, 3):
        with triggers.call("camera.grab", lambda: log.append("check")):
            log.append(f"call {number}")
    assert log == ["check", "call 1", "at 2", "check", "call 2", "after 2", "check", "call 3"]
    assert triggers.pending == 0
    assert triggers.calls == ["camera.grab"] * 3


def test_calls_of_different_names_are_counted_separately() -> None:
    triggers, log = Triggers(), list[str]()
    triggers.plan("at", "theta_r.wait", 1, lambda: log.append("wait 1"))
    for name in ("camera.grab", "theta_i.wait"):
        with triggers.call(name):
            pass
    assert triggers.pending == 1
    with triggers.call("theta_r.wait"):
        assert log == ["wait 1"]
