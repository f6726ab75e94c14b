"""Outcomes of many trials as the tree of faults."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from tests.support.stop_trials.trial import FAULTS, Trial
from tests.support.stop_trials.verdict import Verdict


@dataclass(frozen=True, slots=True)
class Outcome:
    """Trial and its verdict."""

    trial: Trial
    verdict: Verdict


def exceptions(outcomes: Sequence[Outcome]) -> list[str]:
    """Return a line for each exception, and for each trial of which a busy machine made nothing."""
    busy = "the machine was too busy: run it again"
    texts = [(o, (*o.verdict.exceptions, *[busy] * (o.verdict.how == "busy"))) for o in outcomes]
    return [f"{outcome.trial.name}: {text}" for outcome, found in texts for text in found]


def tree(outcomes: Sequence[Outcome]) -> str:
    """Return the table fault x motion: trials, how they ended, exceptions, longest standstill."""
    cells: dict[tuple[str, str], list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        cells[outcome.trial.fault, outcome.trial.motion].append(outcome)
    head = (
        "fault", "motion", "trials", "in motion", "stood", "said", "ended", "finished",
        "exceptions", "longest/s", "beyond braking/s", "machine/s",
    )  # fmt: skip
    rows = [head, *(_row(key, cells[key]) for key in sorted(cells, key=_order)),
            _row(("all", ""), list(outcomes))]  # fmt: skip
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    return "\n".join("  ".join(t.ljust(w) for t, w in zip(r, widths, strict=True)) for r in rows)


def _order(key: tuple[str, str]) -> tuple[int, str]:
    return FAULTS.index(key[0]), key[1]


def _row(key: tuple[str, str], outcomes: list[Outcome]) -> tuple[str, ...]:
    verdicts = [outcome.verdict for outcome in outcomes]
    stood = [v for v in verdicts if v.how == "stood"]
    ways = (sum(v.how == how for v in verdicts) for how in ("stood", "said", "ended", "finished"))
    return (
        *key,
        str(len(verdicts)),
        str(sum(v.moved for v in verdicts)),
        *map(str, ways),
        str(sum(bool(v.exceptions) for v in verdicts)),
        f"{max((v.after_s for v in stood), default=0.0):.2f}",
        f"{max((v.after_s - v.braking_s for v in stood), default=0.0):.2f}",
        f"{max((v.late_s for v in stood), default=0.0):.2f}",
    )
