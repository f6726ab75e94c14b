"""Formats `documents` and `tiled` of `gonio export`."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from acquisition.facility.documents import run_documents
from acquisition.facility.tiled_server import send_run
from acquisition.terminal.console import out
from acquisition.terminal.progress import sign_of_life
from instrument.errors import InputError
from instrument.text.atomic_file import write_whole

DOCUMENTS, TILED = "documents", "tiled"
_SUFFIX = ".jsonl"


def export_documents(run: Path, path: Path) -> None:
    """Write the documents of a run to a file, one a line: `{"name": ..., "doc": ...}`.

    That is the form of bluesky's JSONLinesWriter; a number that is not known is null. Raises
    `InputError` for a file that exists or is named otherwise.
    """
    if path.suffix.lower() != _SUFFIX:
        raise InputError(f"{path}: --output must end in {_SUFFIX} for the format {DOCUMENTS}")
    if path.exists():
        raise InputError(f"{path}: exists already: choose another name for --output")
    with sign_of_life("fit and documents"):
        lines = [
            json.dumps({"name": name, "doc": _without_nan(document)}, allow_nan=False)
            for name, document in run_documents(run)
        ]
    write_whole(path, "".join(f"{line}\n" for line in lines), new=True)
    out.print(str(path), highlight=False, soft_wrap=True)


def export_to_tiled(run: Path, url: str) -> None:
    """Write a run to a Tiled server and print its identifier there."""
    with sign_of_life("fit, and transfer to the Tiled server"):
        uid = send_run(run, url)
    out.print(uid, highlight=False, soft_wrap=True)


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(own) for key, own in value.items()}
    if isinstance(value, list):
        return [_without_nan(own) for own in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
