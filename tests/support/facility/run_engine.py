"""Run engine of bluesky for tests, the documents that it emits, and stages that stand still."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from sim.scene.stage import SimulatedStage

Documents = list[tuple[str, dict[str, Any]]]
DEADLINE_S = 60.0


def engine_and_documents() -> tuple[Any, Documents]:
    """A run engine, and the list to which it appends each document with its name."""
    from bluesky import RunEngine

    documents: Documents = []
    engine = RunEngine(call_returns_result=True)
    engine.subscribe(lambda name, document: documents.append((name, document)))
    return engine, documents


def events(documents: Documents, stream: str) -> list[dict[str, Any]]:
    """Data of the events of one stream, in order."""
    own = [d["uid"] for n, d in documents if n == "descriptor" and d["name"] == stream]
    return [d["data"] for n, d in documents if n == "event" and d["descriptor"] in own]


def stops(documents: Documents) -> list[str]:
    """Exit statuses of the runs that have ended."""
    return [d["exit_status"] for n, d in documents if n == "stop"]


def paused_after(plan: Any, saved: int) -> Any:
    """The plan with a request to pause, at its next checkpoint, after so many events."""
    from bluesky import plan_stubs, preprocessors

    count = 0

    def mutated(message: Any) -> tuple[Any, Any]:
        nonlocal count
        count += message.command == "save"
        due = message.command == "save" and count == saved
        return None, plan_stubs.deferred_pause() if due else None

    return preprocessors.plan_mutator(plan, mutated)


@contextmanager
def begun_in_thread(action: Callable[[], object]) -> Iterator[None]:
    """Do something in a thread of its own, which ends with the `with` block."""
    thread = threading.Thread(target=action, daemon=True)
    thread.start()
    yield
    thread.join(DEADLINE_S)
    assert not thread.is_alive()


class HeldMoves:
    """Moves of one simulated axis that do not end before the axis is stopped, from now on."""

    def __init__(self, patch: pytest.MonkeyPatch, axis: str) -> None:
        self.begun, self.stopped = threading.Event(), threading.Event()
        self.held = True
        wait, begin_stop = SimulatedStage.wait, SimulatedStage.begin_stop

        def held_wait(stage: SimulatedStage) -> float:
            if stage._name == axis and self.held:
                self.begun.set()
                assert self.stopped.wait(DEADLINE_S)
                return stage.position_deg()
            return wait(stage)

        def noted_stop(stage: SimulatedStage) -> None:
            begin_stop(stage)
            if stage._name == axis and self.begun.is_set():
                self.stopped.set()

        patch.setattr(SimulatedStage, "wait", held_wait)
        patch.setattr(SimulatedStage, "begin_stop", noted_stop)
