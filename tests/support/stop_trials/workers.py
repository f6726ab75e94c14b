"""Several trials at once, each in a process without threads: what it forks begins clean."""

from __future__ import annotations

import json
import math
import os
import select
import sys
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import asdict

from tests.support.stop_trials.run_trial import run_trial
from tests.support.stop_trials.tally import Outcome
from tests.support.stop_trials.trial import draw
from tests.support.stop_trials.verdict import Verdict, verdict

_TRIES = 5


def run_all(seeds: Sequence[int], at_once: int, show: bool = False) -> Iterator[Outcome]:
    """Yield the outcomes of the trials of these seeds, as they come."""
    waiting, running = list(reversed(seeds)), dict[int, int]()
    while waiting or running:
        while waiting and len(running) < at_once:
            running |= _fork(waiting.pop(), show)
        for descriptor in select.select(list(running), [], [])[0]:
            with os.fdopen(descriptor, "rb") as pipe:
                data = pipe.read()
            os.waitpid(running.pop(descriptor), 0)
            seed, found = json.loads(data)
            yield Outcome(
                draw(seed), Verdict(**{**found, "exceptions": tuple(found["exceptions"])})
            )


def _fork(seed: int, show: bool) -> dict[int, int]:
    """Run a trial in a process of its own; return the descriptor of its outcome, and the process.

    The outcome comes as one line at the trial's end.
    """
    reading, writing = os.pipe()
    pid = os.fork()
    if pid:
        os.close(writing)
        return {reading: pid}
    os.close(reading)
    try:
        os.write(writing, json.dumps([seed, asdict(_judged(seed, show))]).encode())
    finally:
        os._exit(0)


def _judged(seed: int, show: bool) -> Verdict:
    """Carry out a trial, and again where a busy machine ended it early or made it late."""
    trial = draw(seed)
    for _ in range(_TRIES):
        try:
            seen = run_trial(trial)
            found = verdict(trial, seen)
        except Exception:  # noqa: BLE001 - an error of the trial itself is an exception too
            return Verdict("failed", (f"the trial failed: {traceback.format_exc()}",))
        if show:
            sys.stderr.write(f"{trial}\n{json.dumps(asdict(seen), indent=1, default=str)}\n")
            sys.stderr.flush()
        if found.exceptions or not (math.isnan(seen.struck_s) or found.how == "busy"):
            break
    return found
