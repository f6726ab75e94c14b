"""The stated uncertainty holds on a bench with the defects of a real one, all drawn anew."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.support.whole_scans.coverage_scans import Deviations, by_band, by_parameter
from tests.support.whole_scans.real_bench import (
    pulls_of,
    real_bench_run,
)

_RUNS = 600
_FEW = 2  # in a normal run
_COVERED = 1.96


def _pulls(folder: Path, runs: int, lines: dict[str, float] | None = None) -> list[Deviations]:
    loaded = (real_bench_run(number, folder, runs, lines=lines) for number in range(runs))
    return [pulls_of(one, folder / str(number)) for number, one in enumerate(loaded)]


@pytest.mark.slow
def test_deviations_on_a_real_bench_have_the_size_of_their_u(
    slow: bool, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """Mean, standard deviation and coverage of (value - truth) / u, by band and by parameter.

    `--slow`: 600 runs, within the limits that are asked of them; `--junitxml` shows the figures.
    The points of a run share most errors. Otherwise a few runs, in which nothing is far off.
    """
    found = _pulls(tmp_path, _RUNS if slow else _FEW)
    wrong: list[tuple[str, float, float, float]] = []
    for name, own in {**by_band(found), **by_parameter(found)}.items():
        mean, sd = float(np.mean(own)), float(np.std(own))
        covered = float(np.mean(np.abs(own) < _COVERED))
        record_property(name, f"mean {mean:+.2f} u, sd {sd:.2f} u, within 1.96 u {covered:.1%}")
        if slow and not (abs(mean) <= 0.15 and 0.88 <= sd <= 1.12 and 0.93 <= covered <= 0.97):
            wrong.append((name, round(mean, 2), round(sd, 2), round(covered, 3)))
        if np.max(np.abs(own)) > 6:
            wrong.append((name, mean, sd, float(np.max(np.abs(own)))))
    assert not wrong


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["stray_light", "tile_aged"])
def test_a_correction_that_is_left_out_shows(effect: str, slow: bool, tmp_path: Path) -> None:
    """At grazing view the mean deviation is then beyond its limit."""
    if not slow:
        pytest.skip("with --slow")
    found = _pulls(tmp_path, 200, {effect: 0.0, f"u_{effect}": 0.0})
    assert abs(float(np.mean(by_band(found)["75 to 85 deg"]))) > 0.15
