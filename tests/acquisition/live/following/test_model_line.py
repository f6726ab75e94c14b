"""Line of the best model: it runs through the points as they are shown, with a tile or without."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from acquisition.live.following.curves import Curves
from acquisition.live.following.messages import PointMessages
from acquisition.live.following.model_line import model_content
from acquisition.plan.plan import make_plan
from acquisition.results.reduction import reduced_run
from tests.support.live.runs import begun_run, live_protocol
from tests.support.whole_scans.stopped_scan import scan

Shown = tuple[dict[str, Any], list[dict[str, Any]]]


@pytest.fixture(scope="module", params=[True, False], ids=["white tile", "relative"])
def record_of(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[int | None], Shown]:
    folder = tmp_path_factory.mktemp("lines")
    loaded = live_protocol(folder, tile=request.param)
    plan = make_plan(loaded)
    curves = Curves.of(plan)

    def shown(upto: int | None) -> Shown:
        """Model and points of a scan that has come so far."""
        run = folder / f"run {upto}"
        with begun_run(loaded, run) as record:
            scan(loaded, record, upto=upto)
            reduced = reduced_run(record, loaded)
            points = PointMessages(loaded, curves, ()).of(record.rows(), reduced)
            found = [point for _, point in points if point["kind"] == "point"]
            return model_content(reduced, loaded, curves), found

    return shown


def test_the_line_of_each_curve_runs_through_its_points(
    record_of: Callable[[int | None], Shown],
) -> None:
    model, points = record_of(None)
    assert model["name"] == "oren_nayar"
    assert model["points"] == len(points)
    assert "oren_nayar" in model["text"]
    lines = {line["curve"]: line for line in model["lines"]}
    assert set(lines) == {point["curve"] for point in points}
    for point in points:
        line = lines[point["curve"]]
        assert (line["x_deg"][0], line["x_deg"][-1]) == (-80.0, 80.0)
        expected = np.interp(point["x_deg"], line["x_deg"], line["value"])
        assert abs(point["value"] - expected) < 5 * point["u"] + 0.01 * expected


def test_too_few_points_have_no_line_and_say_so(record_of: Callable[[int | None], Shown]) -> None:
    model, _ = record_of(0)
    assert (model["name"], model["lines"]) == (None, [])
    assert model["text"]
    assert model["verdict"] is None
