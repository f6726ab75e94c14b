"""The table of a run: documented columns, components of u, empty cells for unknown values."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from acquisition.engine.engine import Engine
from acquisition.engine.resume import Progress
from acquisition.plan.plan import make_plan
from acquisition.results.fitting import measurements
from acquisition.results.measurements_csv import COLUMNS, measurements_csv
from acquisition.results.reduction import Reduced, reduce
from acquisition.rig import open_devices
from analysis.data.acceptance import Acceptance
from analysis.data.csv.table import read_table
from analysis.data.measurements import Measurements
from instrument.config.load import Loaded
from instrument.config.protocol import Metadata, References
from instrument.errors import Interlock
from instrument.record.record import Record
from tests.support.scans import changed, small_scan
from tests.support.whole_scans.stopped_scan import scan


@pytest.fixture(scope="module")
def reduced(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reduced]:
    loaded = loaded_once()
    folder: Path = tmp_path_factory.mktemp("table") / "run"
    with Record.create(folder, {}) as record:
        Engine(loaded.protocol, loaded.rig, open_devices(loaded), record, [].append).run(
            make_plan(loaded)
        )
        yield reduce(record.readings(), loaded.protocol, record.checks())


@cache
def loaded_once() -> Loaded:
    return small_scan()


def text(reduced: Reduced) -> str:
    return measurements_csv(reduced, 0.01 * reduced.brdf, reduced.parts, loaded_once())


def table(reduced: Reduced) -> list[dict[str, str]]:
    return list(csv.DictReader(text(reduced).splitlines()))


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


def test_the_table_states_the_rig_and_the_groups_of_shared_errors(reduced: Reduced) -> None:
    rows, rig = table(reduced), loaded_once().rig
    assert {row["beam_length_mm"] for row in rows} == {repr(float(rig.beam_length_mm))}
    assert {row["u_theta_r_deg"] for row in rows} == {repr(float(rig.axes.theta_r.u_deg))}
    assert {row["group_white_tile_certificate"] for row in rows} == {"1"}
    tile = [float(row["u_shared_white_tile_certificate_relative"]) for row in rows]
    assert tile == pytest.approx([0.005 / 0.99] * len(rows))
    assert sorted({row["lamp_setting"] for row in rows}) == ["1", "2"]
    assert {row["group_white_tile_reading"] for row in rows} == {"1", "2"}


def random_case(seed: int) -> tuple[Loaded, int | None, Loaded]:
    """A small scan of random length and noise, with or without references; perhaps stopped.

    Returns the scan, the step after which it stops and is resumed (None: it does not stop), and
    what it is resumed with: perhaps a darker lamp.
    """
    random = np.random.default_rng([13, 2, seed])
    loaded = small_scan(rig=str(random.choice(["bench_12bit", "paper_1995"])), shrink=8)
    views = np.linspace(-70, 70, int(random.integers(4, 9))).round(3).tolist()
    sweep = {
        "theta_i_deg": random.choice([0.0, 20.0, 45.0, 65.0], 2, replace=False).tolist(),
        "dphi_deg": [0.0] if random.random() < 0.6 else [0.0, 37.5],
        "theta_r_deg": views,
    }
    old = loaded.protocol.references
    kept = {name: getattr(old, name) for name in ("white_tile", "drift_check")}
    references = References(**{name: r for name, r in kept.items() if random.random() < 0.7})
    rig = {"simulation": loaded.rig.simulation.model_copy(update={"seed": seed})}
    target = float(random.choice([0.1, 0.7, 0.99]))  # near saturation some points are flagged
    scan = changed(loaded, rig=rig, sweeps=[sweep], references=references, exposure_target=target)
    stop = int(random.integers(3, 16)) if random.random() < 0.5 else None
    lamp = scan.rig.lamp
    darker = lamp.model_copy(
        update={"white_electrons_per_s": random.choice([0.8, 1.0]) * lamp.white_electrons_per_s}
    )
    return scan, stop, changed(scan, rig={"lamp": darker})


def resume(loaded: Loaded, record: Record, darker: bool) -> None:
    """Resume a scan; a tile reading under a darker lamp may contradict those before, and end it."""
    try:
        scan(loaded, record)
    except Interlock:
        assert darker


@pytest.mark.slow
def test_the_table_holds_exactly_what_the_fit_takes(tmp_path: Path, slow: bool) -> None:
    """Every number, group and name; random protocols and seeds, stopped, resumed, flagged."""
    kinds = set()
    for seed in range(200 if slow else 6):
        loaded, stop, resumed = random_case(seed)
        with Record.create(tmp_path / str(seed), {}) as record:
            scan(loaded, record, stop)
            if seed % 3 and Progress.of(record).missing(make_plan(resumed)):
                resume(resumed, record, darker=resumed.rig != loaded.rig)
            found = reduce(record.readings(), loaded.protocol, record.checks())
        path = tmp_path / f"{seed}.csv"
        path.write_text(measurements_csv(found, 0.01 * found.brdf, found.parts, loaded))
        read = read_table(path)
        assert read.flagged == np.sum(~found.valid)
        if not np.any(found.valid):
            assert read.measurements.size == 0
            continue
        assert read.acceptance == Acceptance.of(loaded.rig, loaded.protocol.window)
        assert plain(read.measurements) == plain(measurements(found, loaded))
        kinds.add((found.has_brdf, stop is None, read.flagged > 0))
    assert len(kinds) >= 4


def plain(m: Measurements) -> dict[str, object]:
    """All values as lists; the groups of a shared error are numbers of their own."""
    given = [field.name for field in fields(Measurements) if field.init and field.name != "shared"]
    values = {name: getattr(m, name) for name in given}
    lists = {n: v.tolist() if isinstance(v, np.ndarray) else v for n, v in values.items()}
    errors = [(e.name, e.u_relative.tolist(), e.group.tolist()) for e in m.shared]
    return lists | {"shared": errors}


NOTES = st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1, max_size=40)


@settings(max_examples=30)
@given(NOTES, NOTES)
def test_metadata_follow_in_each_row_and_change_nothing_else(
    reduced: Reduced, note: str, operator: str
) -> None:
    """A quote, a comma or a foreign script in them leaves the other columns as they are."""
    try:
        metadata = Metadata(notes=note, operator=operator, wavelength_nm=550.0)
    except ValidationError:
        return  # begins like a formula
    loaded = changed(loaded_once(), metadata=metadata)
    found = measurements_csv(reduced, 0.01 * reduced.brdf, reduced.parts, loaded)
    rows = list(csv.DictReader(found.split("\n")))
    facts = {"operator": operator.strip(), "wavelength_nm": "550", "notes": note.strip()}
    without = list(csv.DictReader(text(reduced).split("\n")))
    assert rows == [row | facts for row in without]
