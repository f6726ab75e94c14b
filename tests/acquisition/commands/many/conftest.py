"""Runs to be mapped, measured once for the tests of this folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.analysis.no_charts import leave_charts_out
from tests.support.batch.runs import Mapped, mapped_alone, write_runs


@pytest.fixture(scope="package")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs to be copied: a map is written into its run's folder."""
    with pytest.MonkeyPatch.context() as patch:
        leave_charts_out(patch)
        return write_runs(tmp_path_factory.mktemp("measured") / "in")


@pytest.fixture(scope="package")
def alone(measured: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Mapped]:
    """What `gonio map` gives for two of the runs, each alone."""
    return mapped_alone(measured, tmp_path_factory.mktemp("alone"))
