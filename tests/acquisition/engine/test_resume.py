"""A scan that was stopped goes on as if it had never stopped, or says what has changed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.engine.engine import Devices, Engine
from acquisition.measure.drift import Drift
from acquisition.plan.plan import make_plan
from acquisition.results.reduction import reduce
from acquisition.rig import open_devices
from instrument.config.load import Loaded
from instrument.errors import DeviceError
from instrument.record.reading import Reading
from instrument.record.record import Record
from tests.support.scans import changed, small_scan, undated
from tests.support.stand_ins import Spy
from tests.support.stopped_scan import scan


@pytest.fixture(scope="module")
def small() -> Loaded:
    return small_scan()


@pytest.fixture(scope="module")
def whole(small: Loaded, tmp_path_factory: pytest.TempPathFactory) -> list[Reading]:
    """The readings of a scan that nothing interrupted."""
    with Record.create(tmp_path_factory.mktemp("whole") / "run", {}) as record:
        Engine(small.protocol, small.rig, open_devices(small), record, [].append).run(
            make_plan(small)
        )
        return undated(record.readings())


def test_cut_after_any_step_the_rest_is_the_same_to_the_last_digit(
    small: Loaded, whole: list[Reading], tmp_path: Path
) -> None:
    for upto in range(len(whole) - 1):
        with Record.create(tmp_path / str(upto), {}) as record:
            scan(small, record, upto)
            assert len(record.readings()) == upto + 1
            scan(small, record)
            assert undated(record.readings()) == whole
            assert not any(check.jumped for check in record.checks())


@pytest.mark.parametrize("upto", [0, 4, 8, 13])
def test_where_a_person_sets_the_lamp_the_result_is_the_same_too(upto: int, tmp_path: Path) -> None:
    """Its darks come first, and again at a resume: the scan's times are others, no value is."""
    loaded = small_scan("paper_1995")
    brdf = []
    for name, ends in (("whole", (None,)), ("cut", (upto, None))):
        with Record.create(tmp_path / name, {}) as record:
            for end in ends:
                scan(loaded, record, end)
            found = reduce(record.readings(), loaded.protocol, record.checks())
            brdf.append(found.brdf.tolist())
    assert brdf[0] == brdf[1]


def test_cut_again_and_again_the_rest_is_the_same(
    small: Loaded, whole: list[Reading], tmp_path: Path
) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        for upto in range(0, len(whole), 2):
            scan(small, record, upto)
        scan(small, record)
        assert undated(record.readings()) == whole


def test_a_lamp_that_has_jumped_is_counted_from_there_on(
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


def test_a_check_that_found_the_lamp_as_it_was_changes_nothing(
    small: Loaded, tmp_path: Path
) -> None:
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


def test_levels_after_a_jump_refer_to_the_first_check_of_all(whole: list[Reading]) -> None:
    drifts = [r for r in whole if r.kind == "drift" and r.block == 0]
    assert len(drifts) > 2
    plain = Drift.of(whole, 0)
    assert plain.level[0] == 1.0
    assert plain.at(drifts[1].time_s) == pytest.approx(plain.level[1])
    before, share = plain.interpolation(np.array([drifts[1].time_s]))
    assert (before.tolist(), share.tolist()) == ([1], [0.0])


def test_a_stage_that_kept_its_reference_is_not_homed_again(
    small: Loaded, whole: list[Reading], tmp_path: Path
) -> None:
    calls: list[str] = []
    devices = open_devices(small)

    def same_bench(_: Devices) -> Devices:
        """The program died, the rig did not: the same stages, where they were left."""
        axes = {name: Spy(axis, calls, name) for name, axis in devices.axes.items()}
        return replace(devices, axes=axes)  # type: ignore[arg-type]  # spies

    with Record.create(tmp_path / "run", {}) as record:
        scan(small, record, 6, lambda _: devices)
        scan(small, record, None, same_bench)
        assert [r.step for r in record.readings()] == [r.step for r in whole]
    assert not [call for call in calls if call.endswith(".home")]
    stops = [n for n, call in enumerate(calls) if call.endswith(".stop")]
    moves = [n for n, call in enumerate(calls) if call.endswith(".start_move")]
    assert max(stops[:3]) < min(moves)  # whatever still moved has ended first


def test_an_engine_that_has_ended_moves_nothing_again(small: Loaded, tmp_path: Path) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        engine = Engine(small.protocol, small.rig, open_devices(small), record, [].append)
        engine.run(make_plan(small))
        with pytest.raises(DeviceError, match="nothing moves again before the operator"):
            engine.run(make_plan(small))


def test_the_record_holds_what_every_device_said_it_is_set_to(
    small: Loaded, tmp_path: Path
) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        scan(small, record, upto=0)
        settings = record.settings()
    assert set(settings) == {"camera", "theta_i", "dphi", "theta_r"}
    assert settings["theta_r"]["limits_deg"] == "-88 to 88"
    assert settings["camera"]["bit_depth"] == "12"


def test_the_operator_s_word_is_asked_with_what_had_happened_and_written_down(
    small: Loaded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from acquisition.commands import scan as run

    asked: list[str] = []
    monkeypatch.setattr(run, "require_yes", lambda question, *_: asked.append(question))
    with Record.create(tmp_path / "run", {}) as record:
        record.add_event("2026", "fault", "theta_r: stalled at 12 deg")
        run._confirm(False, 9, record)
        run._confirm(True, 9, record)
        said = [text for _, kind, text in record.events() if kind == "resumed"]
    assert len(asked) == 1
    assert "The scan ended with: theta_r: stalled at 12 deg" in asked[0]
    assert "9 readings are missing. Is the rig clear" in asked[0]
    assert said == [
        "the rig may move: yes, asked at the terminal",
        "the rig may move: --yes",
    ]
