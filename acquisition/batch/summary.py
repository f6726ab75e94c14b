"""Outcomes of a command for many sources, and their JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from instrument.errors import GonioError

_WORST_FIRST = (1, 3, 2, 5)  # exit codes: a fault of the program, a disk, the input, the data


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Outcome of a command for one source.

    exit_code: of the command for the source alone. message: of its failure, or a note on its
    result. result: what --json prints for the source alone, None where nothing was read. files:
    content by name, until they are written.
    """

    source: str
    exit_code: int = 0
    message: str = ""
    result: Mapping[str, Any] | None = None
    files: Mapping[str, str | bytes] = field(default_factory=dict)

    @property
    def reason(self) -> str:
        """Message in one line."""
        first, *more = self.message.splitlines() or [""]
        return f"{first} (and {len(more)} more)" if more else first


class SomeFailed(GonioError):
    """Sources without a result; the exit code is that of the worst of them."""

    def __init__(self, outcomes: Sequence[Outcome]) -> None:
        failed = [outcome for outcome in outcomes if outcome.exit_code]
        words = ", ".join(outcome.source for outcome in failed[:3]) + ", ..." * (len(failed) > 3)
        super().__init__(f"{len(failed)} of {len(outcomes)} without a result: {words}")
        codes = {outcome.exit_code for outcome in failed}
        self.exit_code = next(code for code in _WORST_FIRST if code in codes)


def as_json(outcomes: Sequence[Outcome], result: str, *, complete: bool) -> dict[str, Any]:
    """Content of the output of --json; result: name of a source's result, such as "fit".

    `complete`: no source is left out.
    """
    rows = [
        {"source": o.source, "exit_code": o.exit_code, "message": o.message, result: o.result}
        for o in outcomes
    ]
    return {"complete": complete, "results": rows}
