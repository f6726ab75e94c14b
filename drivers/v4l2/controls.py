"""Camera controls (exposure, gain, gamma): set, read back and compared."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass

from drivers.v4l2 import ioctl
from instrument.errors import DeviceError, Interlock


@dataclass(frozen=True, slots=True)
class LabelledControl:
    """A control's label, and the quantity for its number: `factor` times the number, in `unit`."""

    number: int
    label: str
    factor: float = 1.0
    unit: str = ""

    def text(self, value: int) -> str:
        """Return the control's number as a quantity with its unit."""
        return f"{value * self.factor:g}{self.unit}"


EXPOSURE = LabelledControl(ioctl.EXPOSURE_ABSOLUTE, "exposure", 1e-4, " s")
GAIN = LabelledControl(ioctl.GAIN, "gain")
_GAMMA = LabelledControl(ioctl.GAMMA, "gamma", 0.01)  # a USB camera's gamma counts hundredths
_LINEAR = 100
_MOST_ROUNDING = 1.5  # tables of exposures in factors of two round by up to sqrt 2
_AUTOMATIC = (
    (
        LabelledControl(ioctl.EXPOSURE_AUTO, "manual exposure, which is mode"),
        1,
    ),  # V4L2_EXPOSURE_MANUAL
    (LabelledControl(ioctl.AUTOGAIN, "automatic gain"), 0),
    (LabelledControl(ioctl.AUTO_WHITE_BALANCE, "automatic white balance"), 0),
)


class Controls:
    """The controls behind one descriptor; `who` begins every message."""

    def __init__(self, descriptor: int, who: str) -> None:
        self._descriptor, self._who = descriptor, who
        self._standing: dict[LabelledControl, int] = {}  # those that were set
        self._found: dict[LabelledControl, int] = {}  # the others

    @property
    def read_back(self) -> dict[str, str]:
        """Each control, as the camera reported it after it was set, or when it was opened."""
        known = self._found | self._standing
        return {control.label: control.text(value) for control, value in known.items()}

    def note_others(self) -> None:
        """Read every control that was not set and that the camera does not change by itself."""
        numbers = {control.number for control in self._standing}
        for other in ioctl.controls(self._descriptor):
            if other.steady and other.value is not None and other.number not in numbers:
                self._found[LabelledControl(other.number, other.name.lower())] = other.value

    def disable_automatic(self) -> list[str]:
        """Switch off every automatic control that would change the counts.

        Returns the controls that could not be made neutral, in words.
        """
        for control, value in _AUTOMATIC:
            if ioctl.control(self._descriptor, control.number) is not None:
                self.set(control, value)
        return self._linear_gamma()

    def _linear_gamma(self) -> list[str]:
        gamma = ioctl.control(self._descriptor, ioctl.GAMMA)
        if gamma is None:
            return []
        if not gamma.minimum <= _LINEAR <= gamma.maximum:
            span = f"{gamma.minimum} to {gamma.maximum}"
            return [f"gamma of unknown scale ({span}) left at {gamma.value}"]
        self.set(_GAMMA, _LINEAR)
        return []

    def check_range(self, control: LabelledControl, *values: int) -> ioctl.Control:
        """Return the camera's control; raise if it is missing or does not allow a value."""
        found = ioctl.control(self._descriptor, control.number)
        if found is None:
            self._check_presence()
            raise DeviceError(
                f"{self._asked(control, values[0])}, but the camera has no such control; leave it "
                "out of the rig file, or use another camera"
            )
        for value in values:
            if not found.minimum <= value <= found.maximum:
                raise DeviceError(
                    f"{self._asked(control, value)}; the camera allows {_range(found, control)}; "
                    "change the rig file"
                )
        return found

    def set(self, control: LabelledControl, value: int) -> int:
        """Set a control and read it back; anything but exactly this value is an error."""
        read_back = self._write(control, value)
        if read_back != value:
            raise self._other_value(control, value, read_back)
        self._standing[control] = read_back
        return read_back

    def set_rounded(self, control: LabelledControl, value: int) -> int:
        """Set a control that the camera may round, and return the value read back.

        A value that differs by more than a factor of 1.5 is an error: the camera has limited it or
        ignored it.
        """
        read_back = self._write(control, value)
        if not value / _MOST_ROUNDING <= read_back <= value * _MOST_ROUNDING:
            raise self._other_value(control, value, read_back)
        self._standing[control] = read_back
        return read_back

    def require_unchanged(self) -> None:
        """Raise `Interlock` if a control no longer has the value that was read back before.

        It is set back first: a scan that is resumed finds it as it was. Of a USB camera Linux
        answers from its memory, save for the few controls that the camera may change by itself.
        """
        for control, value in (self._standing | self._found).items():
            found = self._read(control)
            if found == value:
                continue
            with suppress(OSError):
                ioctl.set_control(self._descriptor, control.number, value)
            since = "was set" if control in self._standing else "when the camera was opened"
            raise Interlock(
                f"camera settings: {self._who}: {control.label} is {control.text(found)}, but "
                f"{control.text(value)} {since}: another program changes the camera; close it "
                "(v4l2-ctl, guvcview, a browser; fuser -v with the camera's path lists them); the "
                f"frames taken meanwhile are not used, and {control.text(value)} was set again"
            )

    def _write(self, control: LabelledControl, value: int) -> int:
        """Set a control within the camera's range and return the value read back."""
        found = self.check_range(control, value)
        try:
            ioctl.set_control(self._descriptor, found.number, value)
        except OSError as error:
            self._check_presence()
            raise DeviceError(
                f"{self._asked(control, value)}; the camera refused it "
                f"({os.strerror(error.errno or 0)}) although it allows {_range(found, control)}; "
                "look whether another program uses the camera, or plug it in again"
            ) from error
        return ioctl.control_value(self._descriptor, found.number)

    def _read(self, control: LabelledControl) -> int:
        """Return a control's value; a single failed request is repeated if the camera is there."""
        try:
            return ioctl.control_value(self._descriptor, control.number)
        except OSError:
            self._check_presence()
            return ioctl.control_value(self._descriptor, control.number)

    def _other_value(self, control: LabelledControl, value: int, read_back: int) -> DeviceError:
        found = self.check_range(control, value)
        return DeviceError(
            f"{self._asked(control, value)}, the camera took {control.text(read_back)}; it says "
            f"that it allows {_range(found, control)}; ask for what the camera can do"
        )

    def _asked(self, control: LabelledControl, value: int) -> str:
        return f"{self._who}: {control.label} {control.text(value)} asked for"

    def _check_presence(self) -> None:
        """Raise OSError if the camera, and not only the control, is missing."""
        ioctl.capability(self._descriptor)


def _range(found: ioctl.Control, control: LabelledControl) -> str:
    span = f"{control.text(found.minimum)} to {control.text(found.maximum)}"
    return f"{span} in steps of {control.text(found.step)}"
