"""Bench drawn from a seed: reproducible, within its spreads, each size by itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from instrument.config.load import load_rig
from instrument.config.rig import Rig, Simulation
from instrument.config.section import Section
from instrument.config.simulated.spread import Spread
from sim.defects.drawn_bench import drawn_bench
from tests.support.paths import CONFIGS
from tests.support.scans import changed, simulated_scene, small_scan

REAL = load_rig(CONFIGS / "rigs" / "bench_real.yaml")


def sizes(section: Section, path: str = "") -> Iterator[tuple[str, float, list[Spread]]]:
    """Each number of a section by its path, with its spread."""
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, Section):
            yield from sizes(value, f"{path}{name}.")
        elif isinstance(value, float):
            yield f"{path}{name}", value, [m for m in field.metadata if isinstance(m, Spread)]


def bench(seed: int, **keys: Any) -> Rig:
    simulation = {**REAL.simulation.model_dump(), "seed": seed, "drawn": True, **keys}
    return REAL.model_copy(update={"simulation": Simulation.model_validate(simulation)})


def test_a_bench_is_drawn_only_where_asked_for() -> None:
    assert drawn_bench(REAL) is REAL
    drawn = drawn_bench(bench(1))
    assert drawn_bench(drawn) is drawn
    assert drawn_bench(bench(1)) == drawn != drawn_bench(bench(2))
    assert drawn.simulation.seed == 1


def test_sizes_are_within_their_spreads() -> None:
    stated = {path: (size, spread) for path, size, spread in sizes(REAL.simulation)}
    ratios: dict[str, list[float]] = {path: [] for path, (size, s) in stated.items() if size and s}
    for seed in range(60):
        for path, size, _ in sizes(drawn_bench(bench(seed)).simulation):
            if path in ratios:
                ratios[path].append(size / stated[path][0])
            else:
                assert size == stated[path][0]
    assert len(ratios) > 30
    for path, found in ratios.items():
        low, high, mean, sd = (-2, 2, 0, 0.88) if Spread.SIGNED in stated[path][1] else (
            0.5, 1.5, 1, 0.289
        )  # fmt: skip
        assert low <= min(found) < max(found) <= high, path
        assert np.mean(found) == pytest.approx(mean, abs=4 * sd / np.sqrt(60)), path
        assert np.std(found) == pytest.approx(sd, rel=0.5), path
    assert np.linalg.matrix_rank(np.array(list(ratios.values()))) == len(ratios)


def test_one_more_defect_changes_no_other() -> None:
    one, other = (
        {path: size for path, size, _ in sizes(drawn_bench(bench(3, wall_light=w)).simulation)}
        for w in (0.0, 0.01)
    )
    assert {path for path in one if one[path] != other[path]} == {"wall_light"}


def test_a_size_beyond_what_its_key_allows_is_refused() -> None:
    benches = [bench(seed, lamp_defects={"warm_up": 0.5}) for seed in range(40)]
    with pytest.raises(ValueError, match="warm_up"):
        list(map(drawn_bench, benches))


def test_the_scene_is_that_of_the_drawn_bench() -> None:
    small = small_scan()
    scene = simulated_scene(changed(small, rig={"simulation": bench(5).simulation}))
    assert scene.rig.simulation == drawn_bench(bench(5)).simulation
    assert replace(scene).rig is scene.rig
