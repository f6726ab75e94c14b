"""Points without signal: kept if a later reading proves that the lamp was on, else flagged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.interlocks.no_light import LEAST_SIGNAL_U, unlit_steps
from acquisition.results.reduction import reduce
from instrument.config.load import Loaded
from instrument.config.protocol import References
from instrument.record.reading import Reading
from instrument.record.record import Record
from tests.support.scans import changed
from tests.support.whole_scans.lamp_faults import LampFault
from tests.support.whole_scans.stopped_scan import scan


@pytest.fixture(scope="module")
def unchecked(small: Loaded) -> Loaded:
    """A white tile, no drift check."""
    tile = small.protocol.references.white_tile
    return changed(small, references=References(white_tile=tile))


@pytest.mark.parametrize("level", [0.0, 1e-6])
@pytest.mark.parametrize("at_step", [2, 9])
def test_a_lamp_that_goes_out_without_drift_checks_flags_every_point_since(
    at_step: int, level: float, unchecked: Loaded, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    LampFault(at_step={at_step: level}).install(monkeypatch)
    scan(unchecked, record)
    found = reduce(record.readings(), unchecked.protocol, ())
    flagged = {p.step: f for p, f in zip(found.points, found.flags, strict=True) if f}
    assert flagged == {p.step: "no signal" for p in found.points if p.step >= at_step}


def test_a_lamp_that_comes_back_leaves_no_proof_against_the_points_in_the_dark(
    unchecked: Loaded, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They look like points of a sample that is black from there: a bright reading follows."""
    LampFault(at_step={3: 0.0, 5: 1.0}).install(monkeypatch)
    scan(unchecked, record)
    found = reduce(record.readings(), unchecked.protocol, ())
    assert not any(found.flags)


@pytest.mark.parametrize("seed", range(10))
def test_a_dark_point_is_flagged_unless_light_is_proven_later(
    seed: int, whole: list[Reading]
) -> None:
    """Random points without signal; the last readings of each setting are the proof, or are not."""
    random = np.random.default_rng(seed)
    dark = {r.step for r in whole if r.kind == "point" and random.uniform() < 0.5}
    checks_dark = bool(random.integers(2))
    made = [_darkened(r, random) if _is_dark(r, dark, checks_dark) else r for r in whole]
    for reading in made:
        proofs = [
            r.lamp_setting == reading.lamp_setting or r.kind == "drift"
            for r in made
            if r.time_s > reading.time_s and not _is_dark(r, dark, checks_dark)
        ]
        expected = reading.step in dark and not any(proofs)
        assert (reading.step in unlit_steps(made)) == expected


def _is_dark(reading: Reading, dark: set[int], checks: bool) -> bool:
    return reading.step in dark or (checks and reading.kind == "drift")


def _darkened(reading: Reading, random: np.random.Generator) -> Reading:
    u = np.hypot(reading.u_noise_dn, np.hypot(reading.u_quantisation_dn, reading.u_dark_dn))
    return replace(reading, signal_dn=float(u * random.uniform(-LEAST_SIGNAL_U, LEAST_SIGNAL_U)))
