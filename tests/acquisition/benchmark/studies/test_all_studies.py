"""All studies by the command itself."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from acquisition.benchmark.trial import select
from tests.support.benchmark import from_json
from tests.support.command import gonio


@pytest.mark.slow
def test_the_quick_benchmark_leaves_all_its_files(slow: bool, tmp_path: Path) -> None:
    if not slow:
        pytest.skip("all studies take a minute: with --slow; each is tested beside")
    done = gonio("bench", "--quick", "--out", tmp_path / "bench")
    assert done.returncode == 0, done.stderr
    assert "7/7" in done.stderr
    names = {p.name for p in (tmp_path / "bench").iterdir()}
    studies = json.loads((tmp_path / "bench" / "bench.json").read_text())["studies"]
    assert names == {"bench.html", "bench.json", "main_chart.svg"} | {
        f"{study['name']}.csv" for study in studies
    }
    result = from_json((tmp_path / "bench" / "bench.json").read_text())
    for study in result.studies:
        assert {t.scene for t in select(study.trials, default=True)} == set(study.scenes)
