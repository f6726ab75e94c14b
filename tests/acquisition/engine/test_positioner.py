"""Positioner: every axis is stopped in the end, and homed again only where it has to be."""

from __future__ import annotations

from dataclasses import replace

from acquisition.engine.engine import Devices
from acquisition.rig import open_devices
from instrument.config.load import Loaded
from instrument.errors import DeviceError
from instrument.record.reading import Reading
from instrument.record.record import Record
from tests.support.stand_ins import PassThrough, Spy
from tests.support.stopped_scan import scan


class Mute(PassThrough):
    """An axis that does not answer a stop."""

    def stop(self) -> None:
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
    assert calls[-1] == "theta_r.stop"


def test_a_ctrl_c_while_the_rig_is_made_safe_keeps_nothing_from_being_stopped(
    small: Loaded, record: Record
) -> None:
    devices, calls = open_devices(small), []

    class Interrupted(PassThrough):
        """Records each stop when it is called; that of theta_i is interrupted the first time."""

        def __init__(self, name: str) -> None:
            super().__init__(devices.axes[name])
            self._name = name

        def stop(self) -> None:
            calls.append(self._name)
            if calls == ["theta_i"]:
                raise KeyboardInterrupt
            devices.axes[self._name].stop()

    axes = {name: Interrupted(name) for name in devices.axes}
    scan(small, record, changed_devices=lambda _: replace(devices, axes=axes))  # type: ignore[arg-type]  # stand-ins
    assert calls == ["theta_i", "theta_i", "dphi", "theta_r"]


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
    stops = [n for n, call in enumerate(calls) if call.endswith(".stop")]
    moves = [n for n, call in enumerate(calls) if call.endswith(".start_move")]
    assert max(stops[:3]) < min(moves)  # whatever still moved has been stopped first
