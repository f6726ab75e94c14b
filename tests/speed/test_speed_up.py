"""Benchmark of many fits: what it measures, what it compares, and what it draws."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.batch.summary import Outcome
from acquisition.commands.fit import Asked
from acquisition.results.sources import Wanted
from tests.support.speed_up import speed_up as module
from tests.support.speed_up.chart import chart
from tests.support.speed_up.speed_up import (
    Timing,
    measure,
    serial_share,
    speed_up,
    table,
)  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_the_speed_up_lies_between_one_and_the_number_of_processes(seed: int) -> None:
    random = np.random.default_rng(seed)
    share, workers = random.uniform(0.001, 0.5), random.uniform(2, 1000)
    found = speed_up(share, workers)
    assert 1 < found < min(workers, 1 / share)
    assert speed_up(share, 1) == pytest.approx(1)
    assert speed_up(0.0, workers) == pytest.approx(workers)


def _timing(workers: int, wall_s: float) -> Timing:
    return Timing(workers=workers, wall_s=wall_s, serial_s=0.5, work_s=99.5, fits={"a": {}})


def test_table_and_chart_show_what_was_measured() -> None:
    timings = [_timing(1, 100.0), _timing(2, 52.0)]
    assert serial_share(timings[0]) == 0.005
    rows = list(csv.DictReader(table(timings).splitlines()))
    assert [(row["workers"], row["speed_up"]) for row in rows] == [("1", "1.000"), ("2", "1.923")]
    drawn = chart(timings)
    assert drawn.startswith("<svg")
    assert "0.5 % of the work serial" in drawn


Work = Callable[[tuple[str, Path]], Outcome]


@pytest.mark.parametrize("equal", [True, False])
def test_fits_that_depend_on_the_number_of_processes_end_the_benchmark(
    monkeypatch: pytest.MonkeyPatch, equal: bool
) -> None:
    def one_by_one(
        work: Work, items: Sequence[tuple[str, Path]], workers: int
    ) -> Iterator[tuple[tuple[str, Path], Outcome]]:
        for item in items:
            outcome = work(item)
            assert outcome.result is not None
            fit = outcome.result if equal else {**outcome.result, "reason": str(workers)}
            yield item, replace(outcome, result=fit)

    asked = Asked(wanted=Wanted(), models="lambert,oren_nayar_qualitative")
    monkeypatch.setattr(module, "on_processes", one_by_one)
    if equal:
        one, two = measure((1, 2), 1, asked)
        assert one.fits == two.fits
        assert list(one.fits) == ["000.csv"]
        return
    with pytest.raises(RuntimeError, match="2 processes: fits differ"):
        measure((1, 2), 1, asked)
