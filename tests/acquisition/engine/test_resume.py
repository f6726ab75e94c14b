"""Resume: the scan continues as if never stopped, or detects that the lamp has changed."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.engine.resume import Progress, report_found
from acquisition.results.reduction import reduce
from instrument.config.load import Loaded
from instrument.record.reading import Reading
from instrument.record.record import Record
from tests.support.scans import changed, small_scan, undated
from tests.support.whole_scans.stopped_scan import scan, stops


@pytest.mark.slow
def test_cut_after_any_step_the_rest_is_the_same_to_the_last_digit(
    small: Loaded, whole: list[Reading], tmp_path: Path, slow: bool
) -> None:
    for upto in stops(whole, slow):
        with Record.create(tmp_path / str(upto), {}) as record:
            scan(small, record, upto)
            assert len(record.readings()) == upto + 1
            scan(small, record)
            assert undated(record.readings()) == whole
            assert not any(check.jumped for check in record.checks())


@pytest.mark.slow
def test_with_a_lamp_set_by_hand_the_result_is_the_same_too(tmp_path: Path, slow: bool) -> None:
    """Its darks come first, and again at a resume: times differ, and with them the lamp's level.

    The values agree to a few times their noise of 0.01 %.
    """
    loaded = small_scan("paper_1995")
    brdf = []
    for upto in (None, 0, 4, 8, 13) if slow else (None, 0, 8):
        with Record.create(tmp_path / str(upto), {}) as record:
            scan(loaded, record, upto)
            if upto is not None:
                scan(loaded, record)
            brdf.append(reduce(record.readings(), loaded.protocol, record.checks()).brdf)
    for resumed in brdf[1:]:
        assert resumed == pytest.approx(brdf[0], rel=5e-4)


def test_cut_again_and_again_the_rest_is_the_same(
    small: Loaded, whole: list[Reading], tmp_path: Path
) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        for upto in range(0, len(whole), 2):
            scan(small, record, upto)
        scan(small, record)
        assert undated(record.readings()) == whole


def test_an_axis_found_elsewhere_than_at_the_last_reading_is_named(
    small: Loaded, whole: list[Reading], caplog: pytest.LogCaptureFixture
) -> None:
    """As after a kill in the middle of a move; within its tolerance it is where it was."""
    last = whole[5]
    near = 0.9 * small.rig.axes.theta_i.tolerance_deg
    found = {"theta_i": last.theta_i_deg + near, "theta_r": last.theta_r_deg + 12.5}
    report_found(found, Progress(tuple(whole[:6])), small.rig)
    at = f"found at {last.theta_r_deg + 12.5:.4f} deg"
    assert caplog.messages == [
        f"theta_r: {at}; the last reading had been taken at {last.theta_r_deg:g} deg"
    ]


def test_before_the_first_reading_an_axis_is_named_wherever_it_is_found(
    small: Loaded, caplog: pytest.LogCaptureFixture
) -> None:
    report_found({"theta_r": 3.0}, Progress(), small.rig)
    assert caplog.messages == ["theta_r: found at 3.0000 deg; no reading had been taken"]


def test_levels_after_a_jump_of_the_lamp_refer_to_the_check_at_the_resume(
    small: Loaded, whole: list[Reading], tmp_path: Path
) -> None:
    """After the stop the lamp is 20 % darker: the BRDF stays what it was."""
    lamp = small.rig.lamp.model_copy(
        update={"white_electrons_per_s": 0.8 * small.rig.lamp.white_electrons_per_s}
    )
    darker = changed(small, rig={"lamp": lamp})
    with Record.create(tmp_path / "run", {}) as record:
        scan(small, record, upto=8)
        scan(darker, record)
        (check,) = record.checks()
        assert check.jumped
        assert check.reading.signal_dn / check.reading.exposure_s == pytest.approx(
            0.8 * check.expected, rel=2e-3
        )
        assert any("the lamp has jumped" in text for _, _, text in record.events())
        brdf = reduce(record.readings(), small.protocol, record.checks()).brdf
        uncorrected = reduce(record.readings(), small.protocol, ()).brdf
    uninterrupted = reduce(whole, small.protocol, ()).brdf
    assert brdf == pytest.approx(uninterrupted, rel=3e-3)
    assert max(abs(uncorrected / uninterrupted - 1)) > 0.02


@pytest.mark.parametrize("rig", ["bench_12bit", "paper_1995"])
def test_readings_lost_in_the_middle_are_measured_again_with_the_lamp_of_then(
    rig: str, tmp_path: Path
) -> None:
    """After the scan the lamp is 20 % darker; on the second rig it is set by hand for each block.

    A point of each incidence, a tile and a drift check were damaged in the record.
    """
    loaded = small_scan(rig)
    lamp = loaded.rig.lamp.model_copy(
        update={"white_electrons_per_s": 0.8 * loaded.rig.lamp.white_electrons_per_s}
    )
    with Record.create(tmp_path / "run", {}) as record:
        scan(loaded, record)
        whole = record.readings()
        brdf = reduce(whole, loaded.protocol, ()).brdf
        middle = [r.step for r in whole if r.kind == "point"][2::5]
        tile = next(r.step for r in whole if r.kind == "tile")
        drift = [r.step for r in whole if r.kind == "drift"][1]
        lost = sorted([*middle, tile, drift])
        record._damaged = {"reading": tuple(lost)}
        record.remove_damaged()
        assert len(record.readings()) == len(whole) - 4
        scan(changed(loaded, rig={"lamp": lamp}), record)
        found, checks = record.readings(), record.checks()
    assert [r.step for r in found] == [r.step for r in whole]
    assert [c.before_step for c in checks if c.jumped] == (
        lost[:1] if rig == "bench_12bit" else [lost[0], middle[1]]
    )
    again = reduce(found, loaded.protocol, checks).brdf
    assert again == pytest.approx(brdf, rel=4e-3)


def test_a_check_with_an_unchanged_lamp_changes_nothing(small: Loaded, tmp_path: Path) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        scan(small, record, upto=8)
        scan(small, record)
        (check,) = record.checks()
        assert not check.jumped
        assert abs(check.reading.signal_dn / check.reading.exposure_s - check.expected) < (
            4 * check.u_expected
        )
        with_checks = reduce(record.readings(), small.protocol, record.checks())
        without = reduce(record.readings(), small.protocol, ())
        assert with_checks.brdf.tolist() == without.brdf.tolist()
        assert any("as before" in text for _, kind, text in record.events() if kind == "drift")
