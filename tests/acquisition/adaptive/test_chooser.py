"""Choice of a batch: from the readings before the last one alone, within what can be reached."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.adaptive.chooser import FIRST, SECOND
from acquisition.adaptive.course import chooser_of
from acquisition.plan.moves import moves_between
from acquisition.plan.plan import make_plan
from acquisition.plan.pose import home_pose
from analysis.design.optimal import LACK_OF_FIT
from instrument.config.rig import KeepOut
from instrument.errors import InputError
from instrument.record.reading import batches_of
from tests.support.adaptive.predicted_bench import PredictedBench, adaptive_scan
from tests.support.scans import changed


@pytest.mark.slow
@pytest.mark.parametrize("batches", [2, 3, 4])
def test_readings_of_the_last_batch_do_not_matter(batches: int, slow: bool, tmp_path: Path) -> None:
    if not slow and batches != 3:
        pytest.skip("with --slow")
    bench = PredictedBench(adaptive_scan("sigma_deg=0.01"), seed=batches)
    with bench.create(tmp_path / "run") as record:
        while len(batches_of(record.events())) < batches:
            bench.run(record, len(record.readings()))  # chooses a batch
            bench.run(record, sum(len(b.steps) for b in batches_of(record.events())))
        made, readings = batches_of(record.events()), record.readings()
    rng, last = np.random.default_rng(1), set(made[-1].steps)
    other = [
        replace(r, signal_dn=r.signal_dn * rng.uniform(0.5, 2)) if r.step in last else r
        for r in readings
    ]
    chosen = [bench.chooser.propose(made, own, ()) for own in (readings, other, other[::-1])]
    points = [[(step.index, why) for step, why in p.points] for p in chosen]
    assert points[0] == points[1] == points[2]
    earlier = [r for r in readings if r.step not in last]
    assert [(s.index, why) for s, why in bench.chooser.propose(made, earlier, ()).points] == (
        points[0]
    )


def test_the_first_two_batches_are_spread_over_the_list(tmp_path: Path) -> None:
    bench = PredictedBench(adaptive_scan("sigma_deg=0.01"))
    with bench.create(tmp_path / "run") as record:
        plan = bench.run(record, 0)
        bench.run(record, len(plan.known))
        first, second = batches_of(record.events())[:2]
    reasons = [why for batch in (first, second) for why in batch.reasons if why != "reference"]
    assert reasons == [LACK_OF_FIT] * (FIRST + SECOND)
    poses = [bench.plan.steps[index].pose for index in (*first.steps, *second.steps)]
    for theta_i in (30.0, 60.0):
        own = sorted(pose.theta_r for pose in poses if pose.theta_i == theta_i)
        assert own[0] < -60
        assert own[-1] > 60


@pytest.mark.parametrize("seed", range(2))
def test_every_way_is_clear_of_a_random_zone(seed: int, tmp_path: Path) -> None:
    """The lamp cannot turn from one incidence to the other while the camera is in it."""
    rng = np.random.default_rng(seed)
    low, high = sorted(rng.uniform(*((-75, 5) if seed % 2 else (15, 75)), 2).tolist())
    zone = KeepOut(name="post", theta_i_deg=[40.0, 45.0], theta_r_deg=[low, high])
    loaded = changed(adaptive_scan("sigma_deg=0.01", 4.0), rig={"keep_out": [zone]})
    bench = PredictedBench(loaded)
    with bench.create(tmp_path / "run") as record:
        known = bench.run(record).known
    pose = home_pose(loaded.rig)
    for step in known:
        moves_between(pose, step.pose, loaded.rig)  # raises where a zone is met
        pose = step.pose


def test_a_budget_that_is_too_short_for_the_first_batch_is_refused() -> None:
    loaded = adaptive_scan("sigma_deg=0.1", 0.5)
    with pytest.raises(
        InputError, match=r"budget of 0.5 min: the first batch of .* takes"
    ) as error:
        chooser_of(loaded, make_plan(loaded))
    assert "Nothing has moved" in str(error.value)
