"""Follower of a run: what is on its board while the run grows, stops, goes on, and is gone."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from acquisition.adaptive.candidate_list import candidate_list, with_goal
from acquisition.adaptive.course import chooser_of, chosen_while_measured
from acquisition.live.following.board import Board
from acquisition.live.following.run_follower import RunFollower
from acquisition.live.following.run_reader import RunReader
from acquisition.plan.plan import make_plan
from acquisition.results.reduction import reduced_run
from instrument.config.load import Loaded
from instrument.record.event_kinds import DAMAGED, FINISHED, RESUMED, STOPPED
from instrument.record.record import FILE_NAME, Record
from tests.support.live.runs import begun_run, live_protocol, whole_run
from tests.support.live.scan_side import scan_side
from tests.support.timing.deadline import wait_for
from tests.support.whole_scans.stopped_scan import scan

pytestmark = pytest.mark.usefixtures("own_folder")
NOW = "2026-11-28T05:00:00+00:00"


@pytest.fixture
def loaded(tmp_path: Path) -> Loaded:
    return live_protocol(tmp_path)


@contextmanager
def followed(run: Path) -> Iterator[tuple[RunFollower, Board]]:
    board = Board()
    with RunReader(run) as reader, RunFollower(reader, board) as follower:
        follower.poll()
        yield follower, board


def contents(board: Board, kind: str) -> list[Any]:
    return [m.data for m in board.after(0, 10**9) if m.kind == kind]


def kinds_but_models(board: Board, number: int) -> list[str]:
    """Return the kinds of later messages; a model comes when its thread has fitted it."""
    return [m.kind for m in board.after(number, 10**9) if m.kind != "model"]


def state(board: Board) -> str:
    return str(contents(board, "progress")[-1]["state"])


def test_a_scan_that_chooses_its_steps_is_complete_at_its_end_alone(
    loaded: Loaded, tmp_path: Path
) -> None:
    listed = candidate_list(with_goal(loaded, "albedo=0.05", None))
    run, chooser = tmp_path / "run", chooser_of(listed, make_plan(listed))
    with begun_run(listed, run) as record, followed(run) as (follower, board):
        (progress,) = contents(board, "progress")
        assert (progress["done"], progress["total"], progress["state"]) == (0, 0, "measuring")
        plan = chosen_while_measured(chooser, record)
        first = plan.more()
        scan(listed, record, upto=first[-1].index, plan=plan)  # the first batch is measured
        follower.poll()
        progress = contents(board, "progress")[-1]
        assert (progress["done"], progress["total"]) == (len(first), len(first))
        assert progress["state"] == "measuring"
        plan = chosen_while_measured(chooser, record)
        scan(listed, record, plan=plan)
        record.add_event(NOW, FINISHED, "")
        follower.poll()
        progress = contents(board, "progress")[-1]
        assert progress["done"] == progress["total"] == len(plan.known) < len(plan.steps)
        assert progress["state"] == "finished"


def test_a_run_grows_point_by_point(loaded: Loaded, tmp_path: Path) -> None:
    run, plan = tmp_path / "run", make_plan(loaded)
    with begun_run(loaded, run) as record, followed(run) as (follower, board):
        assert contents(board, "point") == []
        (progress,) = contents(board, "progress")
        assert (progress["done"], progress["total"], progress["state"]) == (0, 16, "measuring")
        for upto in (0, 1, 4, 9, None):
            scan(loaded, record, upto=upto)
            follower.poll()
            points = contents(board, "point")
            assert len(points) == (16 if upto is None else upto + 1)
            (progress,) = contents(board, "progress")
            left = sum(step.duration_s for step in plan.steps[len(points) :])
            assert progress["left_s"] == pytest.approx(left, rel=1e-5)
        values = {p["step"]: p["value"] for p in points if p["kind"] == "point"}
        reduced = reduced_run(record, loaded)
        for point, brdf in zip(reduced.points, reduced.brdf, strict=True):
            assert values[point.step] == pytest.approx(float(brdf), rel=1e-4)
        assert all(p["u"] > 0 for p in points if p["kind"] == "point")
        assert not any(p["value"] for p in points if p["kind"] != "point")


def test_points_of_which_nothing_new_is_known_are_not_sent_again(
    loaded: Loaded, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    with begun_run(loaded, run) as record, followed(run) as (follower, board):
        scan(loaded, record, upto=3)
        follower.poll()
        before = board.number
        follower.poll()
        assert kinds_but_models(board, before) == []
        record.add_event(NOW, "retry", "a frame was discarded")
        follower.poll()
        assert kinds_but_models(board, before) == ["happened"]


def test_a_run_that_is_stopped_resumed_and_finished_says_so(loaded: Loaded, tmp_path: Path) -> None:
    run = tmp_path / "run"
    with begun_run(loaded, run) as record:
        scan(loaded, record, upto=5)
        record.add_event(NOW, STOPPED, "stopped by the operator")
    with followed(run) as (follower, board):
        assert state(board) == "stopped"
        text = contents(board, "progress")[-1]["text"]
        assert text == f"stopped by the operator. Go on with: gonio resume {run}"
        with Record.open(run, claim=True) as record:
            record.add_event(NOW, RESUMED, "the rig may move: --yes")
            follower.poll()
            assert state(board) == "measuring"
            scan(loaded, record)
            record.add_event(NOW, FINISHED, "16 steps")
        follower.poll()
        assert state(board) == "finished"
        assert len(contents(board, "point")) == 16


def test_a_stop_is_told_at_the_end_while_the_scan_still_holds_its_run(
    loaded: Loaded, tmp_path: Path
) -> None:
    """The page ends before the program that scans does."""
    with begun_run(loaded, tmp_path / "run") as record:
        scan(loaded, record, upto=4)
        with followed(tmp_path / "run") as (follower, board):
            record.add_event(NOW, STOPPED, "stopped by the operator")
            follower.poll()
            assert state(board) == "measuring"
            follower.finish()
            assert state(board) == "stopped"


def test_a_scan_that_was_killed_is_lost_and_can_be_resumed(loaded: Loaded, tmp_path: Path) -> None:
    run = tmp_path / "run"
    with begun_run(loaded, run) as record:
        scan(loaded, record, upto=2)
    with followed(run) as (_, board):
        (progress,) = contents(board, "progress")
    assert progress["state"] == "lost"
    assert "gonio resume" in progress["text"]
    assert progress["actions"] == []


def test_damaged_readings_that_a_resume_measures_again_come_back(
    loaded: Loaded, tmp_path: Path
) -> None:
    """A record that is open goes on leaving out what was damaged when it was opened."""
    run = whole_run(loaded, tmp_path / "run")
    with closing(sqlite3.connect(run / FILE_NAME)) as database, database:
        database.execute("UPDATE reading SET signal_dn = signal_dn + 1 WHERE step = 5")
    with followed(run) as (follower, board):
        assert len(contents(board, "point")) == 15
        with Record.open(run, claim=True) as record:
            record.add_event(NOW, RESUMED, "the rig may move: --yes")
            follower.poll()
            record.remove_damaged()
            record.add_event(NOW, DAMAGED, "reading 5")
            scan(loaded, record)
        follower.poll()
        assert len(contents(board, "point")) == 16


def test_a_moved_run_is_followed_and_a_removed_one_is_lost(loaded: Loaded, tmp_path: Path) -> None:
    run, elsewhere = tmp_path / "run", tmp_path / "elsewhere"
    with begun_run(loaded, run) as record:
        scan(loaded, record, upto=5)
        record.add_event(NOW, STOPPED, "stopped by the operator")
    with followed(run) as (follower, board):
        run.rename(elsewhere)
        with Record.open(elsewhere, claim=True) as record:
            record.add_event(NOW, RESUMED, "the rig may move: --yes")
            scan(loaded, record)
            record.add_event(NOW, FINISHED, "16 steps")
        follower.poll()
        assert len(contents(board, "point")) == 16
        assert contents(board, "run")[-1]["folder"] == str(elsewhere)
        shutil.rmtree(elsewhere)
        follower.poll()
        assert len(contents(board, "point")) == 16
        assert state(board) == "finished"


def test_a_run_that_is_removed_while_it_is_measured_is_lost(loaded: Loaded, tmp_path: Path) -> None:
    run = tmp_path / "run"
    with begun_run(loaded, run) as record, followed(run) as (follower, board):
        scan(loaded, record, upto=2)
        follower.poll()
        shutil.rmtree(run)
        follower.poll()
        (progress,) = contents(board, "progress")
        assert progress["state"] == "lost"
        assert "removed" in progress["text"]
        assert len(contents(board, "point")) == 3


def test_the_scan_is_asked_and_its_state_is_shown(loaded: Loaded, tmp_path: Path) -> None:
    run = tmp_path / "run"
    with begun_run(loaded, run), followed(run) as (follower, board), board.told(lambda: None):
        with scan_side(run, loaded) as side:
            side.show(1000, step=3)
            expected = {"measuring": ["pause", "abort"], "paused": ["resume", "abort"],
                        "ending": [], "operator": ["abort"]}  # fmt: skip
            for side.phase, actions in expected.items():
                show(follower, board, f"text of {side.phase}")
                assert contents(board, "progress")[-1]["actions"] == actions
            (picture,) = contents(board, "picture")
            assert (picture["step"], picture["caption"]) == (3, "a view")
            (rig,) = contents(board, "rig")
            assert [axis["deg"] for axis in rig["axes"]] == [30.0, None]
            assert rig["lamp"] == "lit"
        progress = polled(follower, board)
        assert (progress["state"], progress["actions"]) == ("measuring", [])
        assert contents(board, "picture") == [None]
        assert contents(board, "rig") == [{"axes": [], "lamp": "unknown"}]


def show(follower: RunFollower, board: Board, text: str) -> None:
    """Look until this text is shown."""
    wait_for(lambda: polled(follower, board)["text"] == text, text)


def polled(follower: RunFollower, board: Board) -> Any:
    follower.poll()
    return contents(board, "progress")[-1]


def test_a_dead_scan_that_left_its_channel_has_no_actions(loaded: Loaded, tmp_path: Path) -> None:
    run = tmp_path / "run"
    with begun_run(loaded, run) as record:
        scan(loaded, record, upto=2)
        with scan_side(run, loaded), followed(run) as (follower, board), board.told(lambda: None):
            wait_for(lambda: bool(polled(follower, board)["actions"]), "the scan's state")
            channel = follower.scan.channel
            left = {path.name: path.read_bytes() for path in channel.glob("*.json")}
    channel.mkdir()
    (channel / "control").touch()
    for name, content in left.items():
        (channel / name).write_bytes(content)
    with followed(run) as (_, board):
        (progress,) = contents(board, "progress")
    assert (progress["state"], progress["actions"]) == ("lost", [])


def test_points_whose_white_tile_comes_after_them_are_shown_before_it(tmp_path: Path) -> None:
    """A lamp that is set by hand: every second setting begins with the sample."""
    loaded = live_protocol(tmp_path, rig="paper_1995")
    steps = make_plan(loaded).steps
    late = max(step.index for step in steps if step.kind == "tile")
    waiting = [s.index for s in steps if s.kind == "point" and s.block == steps[late].block]
    assert max(waiting) < late
    run = tmp_path / "run"
    with begun_run(loaded, run) as record, followed(run) as (follower, board):
        scan(loaded, record, upto=max(waiting))
        follower.poll()
        before = {p["step"]: p for p in contents(board, "point")}
        scan(loaded, record)
        follower.poll()
        after = {p["step"]: p for p in contents(board, "point")}
    assert [s for s, p in before.items() if p["provisional"]] == waiting
    assert not any(p["provisional"] for p in after.values())
    for step in waiting:
        assert before[step]["flags"] == after[step]["flags"]
        assert before[step]["value"] == pytest.approx(after[step]["value"], rel=0.03)
        assert 0 < before[step]["u"] < 0.05 * before[step]["value"]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_follower_that_fails_says_so(
    loaded: Loaded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    with begun_run(loaded, run), followed(run) as (follower, board):
        monkeypatch.setattr(follower, "_state", lambda: 1 // 0)
        follower.start()
        wait_for(lambda: state(board) == "lost", "the end of the follower")
        (progress,) = contents(board, "progress")
    assert "gonio watch" in progress["text"]
    assert "ZeroDivisionError" in progress["text"]
