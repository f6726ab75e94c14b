"""Adaptive scans: the goal is reached, the budget kept, and a resumed one chooses the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.adaptive.aims import Aims
from acquisition.adaptive.course import REFERENCE
from acquisition.adaptive.knowledge import full_fit
from analysis.design.optimal import LACK_OF_FIT
from instrument.config.load import Loaded
from instrument.config.protocol import References
from instrument.errors import InputError
from instrument.record.event_kinds import CHOSEN
from instrument.record.reading import Batch, batches_of
from instrument.record.record import Record
from tests.support.adaptive.predicted_bench import PredictedBench, adaptive_scan

GOAL = "sigma_deg=0.05,albedo=0.02"


@pytest.fixture(scope="module")
def bench() -> PredictedBench:
    return PredictedBench(adaptive_scan(GOAL), seed=1)


@pytest.fixture(scope="module")
def unbroken(bench: PredictedBench, tmp_path_factory: pytest.TempPathFactory) -> list[Batch]:
    """The choices of a scan that nothing interrupted."""
    with bench.create(tmp_path_factory.mktemp("unbroken") / "run") as record:
        bench.run(record)
        return batches_of(record.events())


def _choices(record: Record) -> list[tuple[object, ...]]:
    return [(b.number, b.steps, b.reasons, b.model, b.end) for b in batches_of(record.events())]


def test_the_last_choice_says_why_nothing_follows(unbroken: list[Batch]) -> None:
    *others, last = unbroken
    assert last.end.startswith("the goal is reached: u(sigma_deg)")
    assert not any(batch.end for batch in others)
    assert [batch.number for batch in unbroken] == list(range(len(unbroken)))


def test_a_fifth_of_the_points_is_for_lack_of_fit_and_each_has_a_reason(
    unbroken: list[Batch],
) -> None:
    reasons = [why for batch in unbroken for why in batch.reasons if why != REFERENCE]
    assert reasons.count(LACK_OF_FIT) >= 0.2 * len(reasons)
    assert set(reasons) <= {LACK_OF_FIT, "other models", "sigma_deg", "albedo"}


@pytest.mark.parametrize("seed", range(2))
def test_where_the_goal_is_reached_the_fit_of_the_run_states_that_u(
    seed: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(seed)
    sample = {
        "albedo": rng.uniform(0.2, 0.9),
        "sigma_deg": rng.uniform(10, 30),
        "ks": rng.uniform(0.03, 0.1),
    }
    name = "oren_nayar+torrance_sparrow"
    bench = PredictedBench(adaptive_scan("sigma_deg=0.2"), seed, (name, sample))
    with bench.create(tmp_path / "run") as record:
        bench.run(record)
        (end,) = [batch.end for batch in batches_of(record.events()) if batch.end]
        model, u = full_fit(record.rows(), bench.loaded, Aims.of(bench.loaded))
    assert end.startswith("the goal is reached")
    assert model == name
    assert u["sigma_deg"] is not None
    assert u["sigma_deg"] <= 0.2


def test_killed_at_random_steps_a_scan_goes_on_with_the_same_choices(
    bench: PredictedBench, unbroken: list[Batch], tmp_path: Path
) -> None:
    total = sum(len(batch.steps) for batch in unbroken)
    stops = sorted(np.random.default_rng(5).choice(total, 3, replace=False).tolist())
    with bench.create(tmp_path / "run") as record:
        for upto in stops:
            bench.run(record, upto)
        bench.run(record)
        own = [(b.number, b.steps, b.reasons, b.model, b.end) for b in unbroken]
        assert _choices(record) == own


def test_a_choice_is_on_disk_before_its_first_step(bench: PredictedBench, tmp_path: Path) -> None:
    with bench.create(tmp_path / "run") as record:
        plan = bench.run(record, 0)
        (batch,) = batches_of(record.events())
        assert [step.index for step in plan.known] == list(batch.steps)
        assert not record.readings()


def test_steps_whose_choice_was_lost_are_not_chosen_again(
    bench: PredictedBench, unbroken: list[Batch], tmp_path: Path
) -> None:
    with bench.create(tmp_path / "run") as record:
        bench.run(record, len(unbroken[0].steps))
        readings = record.readings()
    with bench.create(tmp_path / "other") as record:
        for reading in sorted(readings, key=lambda r: r.time_s):
            record.add_reading(reading)
        plan = bench.run(record)
        steps = [step.index for step in plan.known]
        assert len(set(steps)) == len(steps)
        assert set(unbroken[0].steps) <= set(steps)
        assert len(record.readings()) == len(steps)


@pytest.mark.parametrize("budget_min", [3.5])
def test_the_budget_is_kept(budget_min: float, tmp_path: Path) -> None:
    bench = PredictedBench(adaptive_scan("sigma_deg=0.001", budget_min))
    with bench.create(tmp_path / "run") as record:
        plan = bench.run(record)
        last = batches_of(record.events())[-1]
        taken_s = max(reading.free_s for reading in record.readings())
    assert "would exceed the budget" in last.end
    assert bench.chooser.layout.seconds(plan.known) <= 60 * budget_min
    assert 0.8 * 60 * budget_min < taken_s <= 60 * budget_min


def test_what_no_candidate_can_reach_is_said_with_the_source_of_error(tmp_path: Path) -> None:
    bench = PredictedBench(adaptive_scan("albedo=0.0005", models="lambert", views=9),
                           sample=("lambert", {"albedo": 0.5}))  # fmt: skip
    with bench.create(tmp_path / "run") as record:
        bench.run(record)
        end = batches_of(record.events())[-1].end
    assert end.startswith("no more bench time can help: u(albedo)")
    assert "% white tile" in end


@pytest.mark.parametrize(
    "change",
    [
        pytest.param({"incidences": (45.0,)}, id="one incidence"),
        pytest.param({"rig": "paper_1995", "views": 9}, id="a lamp set by hand"),
    ],
)
def test_other_rigs_and_sweeps_end_too(change: dict[str, object], tmp_path: Path) -> None:
    loaded = adaptive_scan("sigma_deg=0.5", 60, **change)  # type: ignore[arg-type]  # of a table
    bench = PredictedBench(loaded)
    with bench.create(tmp_path / "run") as record:
        plan = bench.run(record)
        last = batches_of(record.events())[-1]
    assert last.end
    blocks = [step.block for step in plan.known]
    assert blocks == sorted(blocks)  # a lamp that is set by hand is never set back


def test_without_a_white_tile_shape_parameters_are_reached(tmp_path: Path) -> None:
    references = _without_tile(adaptive_scan(GOAL))
    bench = PredictedBench(adaptive_scan("sigma_deg=0.5", references=references))
    with bench.create(tmp_path / "run") as record:
        bench.run(record)
        assert batches_of(record.events())[-1].end


def _without_tile(loaded: Loaded) -> References:
    return loaded.protocol.references.model_copy(update={"white_tile": None})


def test_a_copy_of_the_record_with_a_step_beyond_the_list_is_refused(
    bench: PredictedBench, tmp_path: Path
) -> None:
    beyond = Batch(number=0, steps=(len(bench.plan.steps),), frames=(4,), reasons=("x",))
    with bench.create(tmp_path / "run") as record:
        record.add_event("", CHOSEN, beyond.text)
        with pytest.raises(InputError, match="is measured or chosen") as refused:
            bench.run(record)
    assert str(tmp_path) in str(refused.value)
