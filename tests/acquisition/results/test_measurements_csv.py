"""The table of a run: documented columns, components of u, empty cells for unknown values."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.engine.engine import Engine
from acquisition.plan.plan import make_plan
from acquisition.results.measurements_csv import COLUMNS, measurements_csv
from acquisition.results.reduction import Reduced, reduce
from acquisition.rig import open_devices
from instrument.record.record import Record
from tests.support.scans import small_scan


@pytest.fixture(scope="module")
def reduced(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reduced]:
    loaded = small_scan()
    folder: Path = tmp_path_factory.mktemp("table") / "run"
    with Record.create(folder, {}) as record:
        Engine(loaded.protocol, loaded.rig, open_devices(loaded), record, [].append).run(
            make_plan(loaded)
        )
        yield reduce(record.readings(), loaded.protocol, record.checks())


def table(reduced: Reduced) -> list[dict[str, str]]:
    return list(csv.DictReader(measurements_csv(reduced, 0.01 * reduced.brdf).splitlines()))


def test_a_row_holds_a_point_and_each_component_of_its_u(reduced: Reduced) -> None:
    rows = table(reduced)
    assert tuple(rows[0])[: len(COLUMNS)] == COLUMNS
    assert len(rows) == len(reduced.points)
    for n, row in enumerate(rows):
        assert float(row["theta_r_deg"]) == reduced.points[n].theta_r_deg
        assert float(row["brdf"]) == pytest.approx(reduced.brdf[n], rel=1e-8)
        assert float(row["u_brdf"]) == pytest.approx(0.01 * reduced.brdf[n], rel=1e-8)
        assert float(row["u_radiance"]) == pytest.approx(reduced.u_radiance[n], rel=1e-8)
        for name, u in reduced.parts.items():
            assert float(row[f"u_{name.replace(' ', '_')}_relative"]) == pytest.approx(u[n])


def test_a_value_that_is_not_known_is_an_empty_cell(reduced: Reduced) -> None:
    brdf = np.where(np.arange(reduced.brdf.size) == 1, np.nan, reduced.brdf)
    rows = table(replace(reduced, brdf=brdf))
    assert (rows[1]["brdf"], rows[1]["u_brdf"]) == ("", "")
    assert float(rows[0]["brdf"]) > 0
