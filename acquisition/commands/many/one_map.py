"""Map of one run among many, in a process of this computer or of a cluster."""

from __future__ import annotations

import contextlib
from functools import partial
from pathlib import Path

from acquisition.batch.summary import Outcome
from acquisition.commands.many.one_source import outcome_of
from acquisition.commands.outcomes.map import Asked, map_json, map_of


def map_one(named: tuple[str, Path], asked: Asked) -> Outcome:
    """Map a run, given by name and path, as `gonio map` does; no error leaves this function."""
    return outcome_of(named, "map", partial(_map_one, asked=asked))


def _map_one(name: str, path: Path, asked: Asked) -> Outcome:
    mapped = map_of(path, asked, lambda _: contextlib.nullcontext())
    found = map_json(mapped.found)
    return Outcome(source=name, message=mapped.note, result=found, files=mapped.files)
