"""Errors that points of a scan share: the drift checks' noise, and thousands of columns at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from acquisition.measure.drift import rate
from acquisition.results.reduction import DRIFT, reduce
from analysis.data.covariance import Covariance
from instrument.config.load import Loaded
from instrument.record.reading import Check, Reading
from instrument.record.record import Record
from tests.support.scans import small_scan
from tests.support.stopped_scan import scan


@pytest.fixture(scope="module")
def small() -> Loaded:
    return small_scan("paper_1995")  # the lamp is set by hand: two blocks, each with its checks


@pytest.fixture(scope="module")
def resumed(
    small: Loaded, tmp_path_factory: pytest.TempPathFactory
) -> tuple[list[Reading], list[Check]]:
    """A scan that was stopped in its first block and went on; the check then says: jumped."""

    with Record.create(tmp_path_factory.mktemp("resumed") / "run", {}) as record:
        scan(small, record, upto=4)
        scan(small, record)
        return record.readings(), [replace(check, jumped=True) for check in record.checks()]


def noisier(reading: Reading, by_u: float) -> Reading:
    return replace(reading, signal_dn=reading.signal_dn + by_u * reading.u_noise_dn)


@pytest.mark.parametrize("jumped", [False, True])
def test_the_drift_checks_noise_is_what_changing_each_of_them_does(
    small: Loaded, resumed: tuple[list[Reading], list[Check]], jumped: bool
) -> None:
    """Each check moved by a part of its u, the points reduced again: their covariance, (N, N)."""
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


def test_levels_are_those_of_the_checks(resumed: tuple[list[Reading], list[Check]]) -> None:
    from acquisition.measure.drift import Drift

    made = [r for r in resumed[0] if r.kind == "drift" and r.block == 1]
    drift = Drift.of(resumed[0], 1)
    times_s = np.array([r.time_s for r in made])
    middle_s = (times_s[:-1] + times_s[1:]) / 2
    before, share = drift.interpolation(np.concatenate([times_s, middle_s]))
    assert before.tolist() == [0, 1, 2, 0, 1]
    assert share == pytest.approx([0, 0, 0, 0.5, 0.5])
    level = [rate(r) / rate(made[0]) for r in made]
    assert drift.at(float(middle_s[0])) == pytest.approx((level[0] + level[1]) / 2)


def test_a_sparse_covariance_is_the_full_one() -> None:
    rng = np.random.default_rng(8)
    common = rng.normal(size=(60, 25)) * (rng.random((60, 25)) < 0.1) * 1e3
    variance, residual = rng.uniform(0.5, 2, 60), rng.normal(size=60)
    full, sparse = Covariance(variance, common), Covariance(variance, csr_array(common))
    good = rng.random(60) < 0.7
    for one, other in ((full, sparse), (full.of(good), sparse.of(good))):
        r = residual[: one.variance.size]
        np.testing.assert_allclose(other.whiten(r), one.whiten(r), atol=1e-9)
        np.testing.assert_allclose(other.pulls(r), one.pulls(r), atol=1e-9)
        np.testing.assert_allclose(other.u_total, one.u_total, rtol=1e-12)
        np.testing.assert_allclose(other.matrix(), one.matrix(), rtol=1e-12)
    white = full.whiten(residual)
    assert white @ white == pytest.approx(residual @ np.linalg.solve(full.matrix(), residual))


def test_a_known_level_of_no_worth_leaves_what_does_not_share_it() -> None:
    """A shared error of 10^5 u: what is alike in all points is nought, the rest stays as it is."""
    C = Covariance(np.ones(50), np.full((50, 1), 1e5))
    rest = np.sin(np.arange(50.0))
    rest -= rest.mean()
    np.testing.assert_allclose(C.whiten(rest + 3e4), rest, atol=0.1)
    white = C.whiten(rest)
    assert white @ white == pytest.approx(rest @ rest, rel=1e-9)
    assert C.pulls(np.full(50, 3e4))[0] == pytest.approx(0.3, rel=1e-9)
