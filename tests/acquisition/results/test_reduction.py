"""Reduction of readings: lamp drift and its noise taken into account; any part is reducible."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.results.effects.lamp_level import DRIFT
from acquisition.results.fitting import measurements
from acquisition.results.measurements_csv import measurements_csv
from acquisition.results.reduction import TILE, TILE_PLACEMENT, reduce, root_sum_square
from analysis.data.csv.table import read_table
from analysis.models import MODELS
from instrument.config.load import Loaded
from instrument.config.protocol import WhiteTile
from instrument.config.rig import SimulatedTile
from instrument.geometry import Geometry
from instrument.record.reading import Check, Reading
from instrument.record.record import Record
from tests.support.scans import changed, small_scan
from tests.support.white_tiles import SPECTRALON, table_text, tabled, with_tile
from tests.support.whole_scans.stopped_scan import scan


@pytest.fixture(scope="module")
def small() -> Loaded:
    return small_scan("paper_1995")  # a lamp set by hand: two blocks, each with its checks


@pytest.fixture(scope="module")
def full() -> Loaded:
    return small_scan(shrink=2)  # pixels enough for small changes


@pytest.fixture(scope="module")
def resumed(
    small: Loaded, tmp_path_factory: pytest.TempPathFactory
) -> tuple[list[Reading], list[Check]]:
    """Readings and checks of a scan resumed in its first block, as if the lamp had jumped."""

    with Record.create(tmp_path_factory.mktemp("resumed") / "run", {}) as record:
        scan(small, record, upto=4)
        scan(small, record)
        return record.readings(), [replace(check, jumped=True) for check in record.checks()]


def noisier(reading: Reading, by_u: float) -> Reading:
    return replace(reading, signal_dn=reading.signal_dn + by_u * reading.u_noise_dn)


@pytest.mark.parametrize("jumped", [False, True])
def test_the_noise_of_drift_checks_is_the_effect_of_changing_each(
    small: Loaded, resumed: tuple[list[Reading], list[Check]], jumped: bool
) -> None:
    """Compared with the covariance (N, N) from reducing the points again with changed checks."""
    readings, checks = resumed
    assert len(checks) == 1
    checks = checks if jumped else []
    found = reduce(readings, small.protocol, checks)
    step, count = 1e-4, 0
    expected = np.zeros((len(found.points), len(found.points)))
    for n, reading in enumerate(readings):
        if reading.kind == "drift":
            other = [*readings[:n], noisier(reading, step), *readings[n + 1 :]]
            change = reduce(other, small.protocol, checks).radiance / found.radiance - 1
            expected, count = expected + np.outer(change, change) / step**2, count + 1
    for check in checks:
        other_check = replace(check, reading=noisier(check.reading, step))
        change = reduce(readings, small.protocol, [other_check]).radiance / found.radiance - 1
        expected, count = expected + np.outer(change, change) / step**2, count + 1
    assert count == 6 + len(checks)  # three a block
    errors = [error for error in found.shared if error.name == DRIFT]
    stated = sum(
        np.outer(e.u_relative, e.u_relative) * (e.group[:, np.newaxis] == e.group) for e in errors
    )
    np.testing.assert_allclose(stated, expected, rtol=2e-3, atol=1e-3 * expected.max())


def test_without_usable_checks_there_is_no_drift_noise(
    small: Loaded, resumed: tuple[list[Reading], list[Check]]
) -> None:
    readings = [replace(r, flags="saturated") if r.kind == "drift" else r for r in resumed[0]]
    assert DRIFT not in reduce(readings, small.protocol, ()).parts


def test_drift_is_followed_and_taken_out(full: Loaded, tmp_path: Path) -> None:
    brdf = []
    for drift in (0.0, 0.9):  # of the lamp, in an hour: 9 % over this scan
        simulation = full.rig.simulation.model_copy(update={"lamp_drift_per_hour": drift})
        loaded = changed(full, rig={"simulation": simulation})
        with Record.create(tmp_path / str(drift), {}) as record:
            scan(loaded, record)
            brdf.append(reduce(record.readings(), loaded.protocol, ()).brdf)
    assert brdf[1] == pytest.approx(brdf[0], rel=2e-3)
    # Not corrected, sample and tile differ by what the lamp did between them.
    raw = _reduced_without_checks(full, tmp_path / "0.9")
    assert np.min(raw / brdf[0]) > 1.01


def _reduced_without_checks(loaded: Loaded, folder: Path) -> np.ndarray:
    with Record.open(folder) as record:
        readings = [r for r in record.readings() if r.kind != "drift"]
        return reduce(readings, loaded.protocol, ()).brdf


def test_a_scan_cut_at_any_step_can_be_reduced(full: Loaded, tmp_path: Path) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        scan(full, record)
        readings = record.readings()
    for count in range(len(readings) + 1):
        reduced = reduce(readings[:count], full.protocol, ())
        assert len(reduced.flags) == len(reduced.points)
        assert np.all(np.isfinite(reduced.brdf[reduced.valid]))


def test_one_placement_of_the_tile_shifts_all_values_that_it_serves(
    small: Loaded, resumed: tuple[list[Reading], list[Check]]
) -> None:
    """Move the tile by its u at every reading between two swaps, and compare the change."""
    readings = resumed[0]
    found = reduce(readings, small.protocol, ())
    moved = [
        replace(r, signal_dn=r.signal_dn - r.u_placement_dn) if r.kind == "tile" else r
        for r in readings
    ]
    change = reduce(moved, small.protocol, ()).brdf / found.brdf - 1
    stated = [e for e in found.shared_by_tile if e.name == TILE_PLACEMENT]
    assert len(stated) == 1
    np.testing.assert_allclose(change, stated[0].u_relative, rtol=2e-3)
    assert np.all(stated[0].u_relative != 0)
    setting = [p.lamp_setting for p in found.points]  # by hand, and the tile is placed for each
    assert np.unique(np.column_stack([stated[0].group, setting]), axis=0).shape[0] == 2


@pytest.fixture(scope="module")
def seen_with_ptfe(full: Loaded, tmp_path_factory: pytest.TempPathFactory) -> list[Reading]:
    """Readings of a scan whose tile is like sintered PTFE, which no certificate has told."""
    tile, sample = full.protocol.references.white_tile, full.protocol.simulated_sample
    assert tile is not None
    assert sample is not None
    even = changed(full, simulated_sample=sample.model_copy(update={"mottling": 0.0}))
    with Record.create(tmp_path_factory.mktemp("ptfe") / "run", {}) as record:
        scan(with_tile(even, tile, SPECTRALON), record)
        return record.readings()


def _against_the_truth(readings: list[Reading], loaded: Loaded) -> tuple[np.ndarray, np.ndarray]:
    """Relative error of each BRDF and its stated u, (N,); the angles are but little off."""
    found, sample = reduce(readings, loaded.protocol, ()), loaded.protocol.simulated_sample
    assert sample is not None
    angles = {n: [getattr(p, f"{n}_deg") for p in found.points] for n in ("theta_i", "theta_r")}
    dphi = [p.dphi_deg for p in found.points]
    geometry = Geometry.from_degrees(**angles, dphi=dphi)
    truth = MODELS[sample.model].brdf(geometry, **sample.parameters)
    u = root_sum_square(list(found.parts.values()))
    return found.brdf / truth - 1, u


def test_a_tile_of_ptfe_biases_by_several_per_cent_with_one_number(
    full: Loaded, seen_with_ptfe: list[Reading]
) -> None:
    """Its hemispherical reflectance is right, 0.984; only a u that grows holds what it is off."""
    bare = WhiteTile(reflectance=0.984, u_reflectance=0.004, theta_r_deg=10.0)
    stated = bare.model_copy(update={"certificate": "8/hemispherical"})
    error, u = _against_the_truth(seen_with_ptfe, with_tile(full, bare))
    assert np.max(np.abs(error)) > 0.035
    assert np.max(np.abs(error) / u) > 6
    error, u = _against_the_truth(seen_with_ptfe, with_tile(full, stated))
    assert np.max(np.abs(error)) > 0.035
    assert np.max(np.abs(error) / u) < 2


def test_with_a_table_the_values_are_right_within_their_u(
    full: Loaded, seen_with_ptfe: list[Reading], tmp_path: Path
) -> None:
    """Certificates with drawn errors; the rest of u is small beside theirs."""
    pulls = []
    for seed in range(40):
        text = table_text(SPECTRALON, 0.003, 0.004, np.random.default_rng(seed))
        tile = tabled(text, tmp_path)
        error, u = _against_the_truth(seen_with_ptfe, with_tile(full, tile))
        assert np.max(np.abs(error)) < 0.025
        pulls.append(error / u)
    assert abs(np.mean(pulls)) < 0.5
    assert 0.75 < np.sqrt(np.mean(np.square(pulls))) < 1.25


def test_a_constant_table_reduces_as_its_number(
    small: Loaded, resumed: tuple[list[Reading], list[Check]], tmp_path: Path
) -> None:
    text = table_text(SimulatedTile(at_normal=0.99), 0.0, 0.005)
    one = WhiteTile(reflectance=0.99, u_reflectance=0.005, theta_r_deg=10.0)
    first, second = (
        reduce(resumed[0], with_tile(small, tile).protocol, resumed[1])
        for tile in (one, tabled(text, tmp_path))
    )
    np.testing.assert_array_equal(first.brdf, second.brdf)
    assert first.parts.keys() == second.parts.keys()
    for name, u in first.parts.items():
        np.testing.assert_array_equal(u, second.parts[name])


def test_a_table_of_results_states_the_errors_of_the_tile_s_table(
    full: Loaded, seen_with_ptfe: list[Reading], tmp_path: Path
) -> None:
    loaded = with_tile(full, tabled(table_text(SPECTRALON, 0.003, 0.004), tmp_path))
    found = reduce(seen_with_ptfe, loaded.protocol, ())
    path = tmp_path / "measurements.csv"
    path.write_text(measurements_csv(found, 0.01 * found.brdf, found.parts, loaded))
    read, own = (
        [(e.name, e.u_relative.tolist(), e.group.tolist()) for e in m.shared if e.name == TILE]
        for m in (read_table(path).measurements, measurements(found, loaded))
    )
    assert len(own) >= 2
    assert read == own
