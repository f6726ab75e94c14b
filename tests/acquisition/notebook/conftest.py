"""One small run of the demonstration for all tests of this room."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.notebook.runs import Run
from acquisition.notebook.scans import run
from tests.support.scans import TWO_MODELS, small_demo


@pytest.fixture(scope="session")
def scanned(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run made from Python, without a window of its own left open."""
    folder: Path = tmp_path_factory.mktemp("notebook")
    return run(small_demo(folder, TWO_MODELS), out=folder / "run")
