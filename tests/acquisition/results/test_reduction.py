"""Reduction of readings: noise of the drift checks as an error that points share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.results.reduction import DRIFT, reduce
from instrument.config.load import Loaded
from instrument.record.reading import Check, Reading
from instrument.record.record import Record
from tests.support.scans import small_scan
from tests.support.stopped_scan import scan


@pytest.fixture(scope="module")
def small() -> Loaded:
    return small_scan("paper_1995")  # a lamp set by hand: two blocks, each with its checks


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
