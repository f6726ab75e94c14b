"""Item of work that never gave a result, whoever worked on it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Lost:
    """Item without a result, as its process ended each time; `reason` says what to do next."""

    reason: str
