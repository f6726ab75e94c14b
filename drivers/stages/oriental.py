"""Rotary stages behind Oriental Motor's AZ drives: Modbus RTU, or Modbus TCP through a gateway.

No move is sent twice on a guess. If the answer to one is lost, the drive's registers are read to
find out whether the move was taken.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from drivers.lines.modbus_bus import AnswerLost, ModbusBus, ModbusUnit
from drivers.stages import oriental_framing as framing
from drivers.stages.motion import STARTS_WITHIN_S, Limits, Status
from drivers.stages.motor_stage import POLL_S, MotorStage, Stopped
from instrument.clock import Clock
from instrument.errors import DeviceError, InputError

log = logging.getLogger(__name__)

_RESYNC_COUNTS = (6, 8, 10, 12, 14)  # of the direct data; no other request here has these lengths


class OrientalStage(MotorStage):
    """One AZ drive. Drives on one port share a `bus`, which is closed by whoever opened it.

    `steps_per_deg` follows from the gear and the drive's electronic gear. Raises `InputError` for a
    tolerance that the drive's steps cannot keep.
    """

    def __init__(
        self,
        name: str,
        bus: ModbusBus,
        unit: int,
        steps_per_deg: float,
        limits: Limits,
        clock: Clock,
    ) -> None:
        if limits.tolerance_deg < 0.5 / steps_per_deg:
            raise InputError(
                f"tolerance_deg: {limits.tolerance_deg:g} deg: less than half a step "
                f"({0.5 / steps_per_deg:g} deg) cannot be kept"
            )
        super().__init__(name, limits, clock, reply_s=bus.settings.reply_s)
        self._unit, self._steps_per_deg, self._reply_s = unit, steps_per_deg, bus.settings.reply_s
        self._drive = ModbusUnit(bus, name, unit, framing.DIRECT_DATA, _RESYNC_COUNTS)
        self._stops, self._cleared = 0, -1  # stops sent; how many of them are cleared in 007D
        self._target_steps = self._identify()

    def identity(self) -> str:
        """Return the drive's kind and its unit address; it has no name or serial number."""
        return f"Oriental Motor AZ drive, by its registers, unit {self._unit}"

    def status(self, retry: bool = True) -> Status:
        """Read the output word, then the feedback position."""
        return self._status(self._drive.deadline_s() if retry else self._clock.now_s())

    def _status(self, until_s: float) -> Status:
        output = self._output(until_s)  # first: the position read after it is then one at rest
        return Status(
            framing.degrees_of(self._feedback(until_s), self._steps_per_deg),
            moving=output.has(framing.MOVE),
            homed=output.has(framing.HOME_END),
            fault=output.fault,
        )

    def _send_harder_stop(self) -> None:
        """Send STOP as a new edge; FREE would only let go of a beam, which may then fall."""
        self._drive.write_at_once(framing.INPUT_WORD, 0)
        self._send_stop()

    def _status_after_stop(self) -> Status:
        """Read the status, with the time to get in step again after a lost answer."""
        return self._status(self._clock.now_s() + 2 * self._reply_s)

    def _own_limits_deg(self) -> tuple[float, float]:
        """Return infinite limits: the registers of an AZ drive's software limits are not known."""
        return -float("inf"), float("inf")

    def _identify(self) -> int:
        """Return the target held in the registers; refuse what is no AZ drive."""
        until_s = self._drive.deadline_s()
        output = self._output(until_s)
        data = self._direct_data(until_s)
        mismatch = framing.az_mismatch(data, output)
        if mismatch:
            raise DeviceError(
                f"{self.name}: {self._drive.where} is no Oriental Motor AZ drive: {mismatch}: look "
                "at the port and the unit address in the rig file"
            )
        return data.position

    def _send_home(self) -> None:
        self._wait_until_ready("look for its reference")
        self._set_inputs(framing.ZHOME)
        self._set_inputs(0)

    def _apply_speed(self) -> None:
        """Do nothing: each move command contains its speed."""

    def _send_move(self, angle_deg: float) -> None:
        scale, limits = self._steps_per_deg, self._limits
        target = framing.steps_of(angle_deg, scale)
        block = framing.move_block(
            target,
            framing.steps_of(limits.speed_deg_per_s, scale),
            framing.steps_of(limits.acceleration_deg_per_s2, scale),
        )
        self._wait_until_ready("move")
        until_s, before = self._drive.deadline_s(), self._target_steps

        def taken() -> bool:
            return self._move_taken(target, before, until_s)

        self._write_once(framing.DIRECT_DATA, block, taken, until_s)
        self._target_steps = target

    def _send_stop(self) -> None:
        self._stops += 1  # before it is sent: the next motion must clear it
        try:
            self._drive.write_at_once(framing.INPUT_WORD, framing.STOP)
        except AnswerLost as lost:
            raise type(lost)(f"{lost}; STOP was not acknowledged") from lost

    def _wait_until_ready(self, purpose: str) -> None:
        """Clear an earlier stop, and wait until the drive accepts commands."""
        stops = self._stops
        if self._cleared != stops:
            self._set_inputs(0)
            self._cleared = stops
        begun_s = self._clock.now_s()
        while not (output := self._output(self._drive.deadline_s())).has(framing.READY):
            self._raise_if_stopped()
            if output.fault:
                raise DeviceError(f"{self.name}: {output.fault}")
            if self._clock.now_s() - begun_s > STARTS_WITHIN_S:
                raise DeviceError(
                    f"{self.name}: its drive is not ready to {purpose} (output {output.word:04X} "
                    "hex, READY is bit 5): look at its motor's supply and its STOP and FREE inputs"
                )
            self._clock.sleep(POLL_S)

    def _set_inputs(self, word: int) -> None:
        """Set the input word; setting the same word again makes no edge and starts nothing."""
        until_s = self._drive.deadline_s()

        def taken() -> bool:
            return self._drive.read(framing.INPUT_WORD, 1, until_s) == [word]

        self._write_once(framing.INPUT_WORD, (word,), taken, until_s)

    def _move_taken(self, target: int, before: int, until_s: float) -> bool:
        """Return True if a move whose answer was lost has been executed."""
        data = self._direct_data(until_s)
        self._target_steps = data.position
        if data.position != target or before != target:
            return data.position == target
        # The target is the previous one: only motion or arrival shows that the move was taken.
        if self._output(until_s).has(framing.MOVE):
            return True
        allowed = self._limits.tolerance_deg * self._steps_per_deg
        return abs(self._feedback(until_s) - target) <= allowed

    def _write_once(
        self, register: int, values: tuple[int, ...], taken: Callable[[], bool], until_s: float
    ) -> None:
        """Write; after a lost answer ask `taken`, and write once more only if it was not."""
        for last in (False, True):
            try:
                return self._drive.write(register, values, until_s, self._raise_if_stopped)
            except AnswerLost as lost:
                log.warning("%s", lost)
                if self._confirm(taken, lost):
                    return None
                if last or self._clock.now_s() > until_s:
                    raise
        return None

    def _confirm(self, taken: Callable[[], bool], lost: DeviceError) -> bool:
        try:
            return taken()
        except AnswerLost as worse:
            raise type(worse)(
                f"{worse} (before: {lost}); whether the drive has taken its last command is not "
                "known: it may move"
            ) from worse

    def _raise_if_stopped(self) -> None:
        if self._stopped:
            self._raise_if_unwatched()
            raise Stopped(f"{self.name}: stopped before it began to move")

    def _output(self, until_s: float) -> framing.Output:
        return framing.output_of(
            self._drive.read(framing.OUTPUT, framing.OUTPUT_AND_ALARM_COUNT, until_s)
        )

    def _direct_data(self, until_s: float) -> framing.DirectData:
        words = self._drive.read(framing.DIRECT_DATA, framing.DIRECT_DATA_COUNT, until_s)
        return framing.direct_data_of(words)

    def _feedback(self, until_s: float) -> int:
        return framing.value_of(self._drive.read(framing.FEEDBACK_POSITION, 2, until_s))
