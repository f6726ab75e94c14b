"""Plan and the white tile's table: a geometry outside it is an error before anything moves."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.plan.plan import make_plan
from instrument.errors import InputError
from tests.support.scans import changed, small_scan
from tests.support.white_tiles import SPECTRALON, table_text, tabled, with_tile


def test_a_plan_inside_the_table_is_made(tmp_path: Path) -> None:
    tile = tabled(table_text(SPECTRALON, 0.003, 0.0), tmp_path)
    assert make_plan(with_tile(small_scan(), tile)) == make_plan(small_scan())


@pytest.mark.parametrize(
    ("sweep", "view", "text"),
    [
        ({"theta_i_deg": [30.0, 80.0]}, 10.0, "theta_i 80 deg; the table has 0 to 75 deg"),
        ({}, 12.0, "theta_r 12 deg; the table has only 10 deg (at 2 settings of the lamp)"),
    ],
)
def test_an_angle_outside_the_table_is_named_with_its_range(
    sweep: dict[str, list[float]], view: float, text: str, tmp_path: Path
) -> None:
    tile = tabled(table_text(SPECTRALON, 0.003, 0.0), tmp_path, theta_r_deg=view)
    loaded = with_tile(small_scan(), tile)
    loaded = changed(loaded, sweeps=[loaded.protocol.sweeps[0] | sweep])
    with pytest.raises(InputError) as caught:
        make_plan(loaded)
    problem = caught.value.problems[0]
    assert problem.startswith(f"{loaded.protocol_path}:")
    start = "references.white_tile.table: tile.csv has no value for the reading of the tile at"
    assert f": {start} {text}; allowed: angles inside the table: change sweeps or" in problem
