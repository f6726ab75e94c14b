"""Positioner: every axis is stopped in the end, and homed again only where it has to be."""

from __future__ import annotations

from dataclasses import replace

import pytest

from acquisition.engine.engine import Devices
from acquisition.rig import open_devices
from instrument.config.load import Loaded
from instrument.errors import ComputerPaused, DeviceError
from instrument.record.reading import Reading
from instrument.record.record import Record
from tests.support.scans import undated
from tests.support.stand_ins import PassThrough, Spy
from tests.support.whole_scans.stopped_scan import scan


class Mute(PassThrough):
    """An axis that does not answer a stop."""

    def begin_stop(self) -> None:
        raise DeviceError("theta_i: no answer")


def test_an_axis_that_does_not_answer_keeps_no_other_from_being_stopped(
    small: Loaded, record: Record
) -> None:
    devices, calls = open_devices(small), []
    axes = devices.axes | {
        "theta_i": Mute(devices.axes["theta_i"]),
        "theta_r": Spy(devices.axes["theta_r"], calls, "theta_r"),
    }
    scan(small, record, changed_devices=lambda _: replace(devices, axes=axes))  # type: ignore[arg-type]  # stand-ins
    assert calls[-2:] == ["theta_r.begin_stop", "theta_r.finish_stop"]


@pytest.mark.parametrize("times", [1, 2, 5])
def test_a_ctrl_c_while_the_rig_is_made_safe_keeps_nothing_from_being_stopped(
    small: Loaded, record: Record, times: int
) -> None:
    devices, calls = open_devices(small), []

    class Interrupted(PassThrough):
        """Records each stop when it is called; that of theta_i is interrupted a few times."""

        def __init__(self, name: str) -> None:
            super().__init__(devices.axes[name])
            self._name = name

        def begin_stop(self) -> None:
            calls.append(self._name)
            if len(calls) <= times:
                raise KeyboardInterrupt
            devices.axes[self._name].begin_stop()

    axes = {name: Interrupted(name) for name in devices.axes}
    scan(small, record, changed_devices=lambda _: replace(devices, axes=axes))  # type: ignore[arg-type]  # stand-ins
    assert calls == [*["theta_i"] * (times + 1), "dphi", "theta_r"]


def test_a_stage_that_kept_its_reference_is_not_homed_again(
    small: Loaded, whole: list[Reading], record: Record
) -> None:
    calls: list[str] = []
    devices = open_devices(small)

    def same_bench(_: Devices) -> Devices:
        """The program died, the rig did not: the same stages, where they were left."""
        axes = {name: Spy(axis, calls, name) for name, axis in devices.axes.items()}
        return replace(devices, axes=axes)  # type: ignore[arg-type]  # spies

    scan(small, record, 6, lambda _: devices)
    scan(small, record, None, same_bench)
    assert [r.step for r in record.readings()] == [r.step for r in whole]
    assert not [call for call in calls if call.endswith(".home")]
    stops = [n for n, call in enumerate(calls) if call.endswith(".finish_stop")]
    moves = [n for n, call in enumerate(calls) if call.endswith(".start_move")]
    assert max(stops[:3]) < min(moves)  # whatever still moved has been stopped first


class Pausing(PassThrough):
    """Axis during some of whose calls the computer pauses, so that its stage is stopped.

    `calls` counts the moves begun; `pauses` names a method and the moves in which it is hit.
    """

    def __init__(self, device: object, method: str, pauses: set[int], homed: bool = True) -> None:
        super().__init__(device)
        self._method, self._pauses, self._homed = method, pauses, homed
        self.moves = 0
        self.read_back: list[str] = []

    def start_move(self, angle_deg: float) -> None:
        self.moves += 1
        if self._method == "start_move" and self.moves in self._pauses:
            raise ComputerPaused("theta_r: the computer paused for 1.3 s while it moved")
        self._device.start_move(angle_deg)  # type: ignore[attr-defined]  # an axis

    def finish_move(self) -> None:
        if self._method == "finish_move" and self.moves in self._pauses:
            raise ComputerPaused("theta_r: the computer paused for 1.3 s while it moved")
        self._device.finish_move()  # type: ignore[attr-defined]  # an axis

    def homed(self) -> bool:
        self.read_back.append("homed")
        return self._homed

    def position_deg(self) -> float:
        self.read_back.append("position")
        return self._device.position_deg()  # type: ignore[attr-defined,no-any-return]  # an axis


def paused_scan(small: Loaded, record: Record, **keys: object) -> tuple[Pausing, Exception | None]:
    devices = open_devices(small)
    axis = Pausing(devices.axes["theta_r"], **keys)  # type: ignore[arg-type]  # as given
    axes = devices.axes | {"theta_r": axis}
    try:
        scan(small, record, changed_devices=lambda _: replace(devices, axes=axes))  # type: ignore[arg-type]  # stand-ins
    except ComputerPaused as error:
        return axis, error
    return axis, None


@pytest.mark.parametrize("method", ["start_move", "finish_move"])
def test_after_a_pause_of_the_computer_the_move_is_made_again(
    small: Loaded, whole: list[Reading], record: Record, method: str
) -> None:
    axis, error = paused_scan(small, record, method=method, pauses={2, 5, 9})
    assert error is None
    assert undated(record.readings()) == undated(whole)
    assert axis.read_back[:2] == ["homed", "position"]


@pytest.mark.parametrize("method", ["start_move", "finish_move"])
@pytest.mark.parametrize(
    ("pauses", "homed", "says"),
    [
        ({2, 3}, True, "again in this move, which is too often to go on"),
        ({2, 4, 6, 8}, True, "4 times in this scan, which is too often to go on"),
        ({2}, False, "theta_r has lost its reference"),
    ],
)
def test_pauses_end_the_scan_beyond_their_bounds(
    small: Loaded, record: Record, method: str, pauses: set[int], homed: bool, says: str
) -> None:
    axis, error = paused_scan(small, record, method=method, pauses=pauses, homed=homed)
    assert says in str(error)
    assert axis.moves == max(pauses)  # and nothing moves after it


def test_the_axis_that_moves_is_stopped_first(small: Loaded, record: Record) -> None:
    """A stop may wait for a port that has vanished: what moves must not wait behind it."""
    calls: list[str] = []
    devices = open_devices(small)

    class Failing(Spy):
        def __getattr__(self, name: str) -> object:
            if name == "finish_move" and self._name == "theta_r":
                raise DeviceError("theta_r: is gone")
            return super().__getattr__(name)

    axes = {name: Failing(axis, calls, name) for name, axis in devices.axes.items()}
    with pytest.raises(DeviceError, match="is gone"):
        scan(small, record, changed_devices=lambda _: replace(devices, axes=axes))  # type: ignore[arg-type]  # stand-ins
    stops = [call for call in calls if call.endswith("_stop")]
    order = ["theta_r", "theta_i", "dphi"]
    assert stops == [f"{name}.{half}_stop" for half in ("begin", "finish") for name in order]
