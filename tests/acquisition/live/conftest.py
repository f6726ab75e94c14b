"""Temporary folder of a test's own: channels of several tests at a time do not meet."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Short, as the path of a socket has at most 107 bytes; `tmp_path` is then elsewhere."""
    with tempfile.TemporaryDirectory(prefix="g-", dir="/tmp") as name:
        monkeypatch.setattr(tempfile, "tempdir", name)
        monkeypatch.setenv("TMPDIR", name)
        yield Path(name)
