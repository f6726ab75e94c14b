"""A camera's controls, set and read back: what the camera made of it is never taken on trust."""

from __future__ import annotations

import os
from dataclasses import dataclass

from drivers.v4l2 import ioctl as v4l2
from instrument.errors import DeviceError


@dataclass(frozen=True, slots=True)
class Wish:
    """A control in words, and how its number reads as a quantity: `factor` times it, `unit`."""

    number: int
    words: str
    factor: float = 1.0
    unit: str = ""

    def text(self, value: int) -> str:
        """The control's number as a quantity."""
        return f"{value * self.factor:g}{self.unit}"


EXPOSURE = Wish(v4l2.EXPOSURE_ABSOLUTE, "exposure", 1e-4, " s")
GAIN = Wish(v4l2.GAIN, "gain")
_GAMMA = Wish(v4l2.GAMMA, "gamma", 0.01)  # a USB camera's gamma counts hundredths
_LINEAR = 100
_AUTOMATICS = (
    (Wish(v4l2.EXPOSURE_AUTO, "manual exposure, which is mode"), 1),  # V4L2_EXPOSURE_MANUAL
    (Wish(v4l2.AUTOGAIN, "automatic gain"), 0),
    (Wish(v4l2.AUTO_WHITE_BALANCE, "automatic white balance"), 0),
)


class Controls:
    """The controls behind one descriptor; `who` begins every message."""

    def __init__(self, descriptor: int, who: str) -> None:
        self._descriptor, self._who = descriptor, who
        self.read_back: dict[str, str] = {}
        """What was set, as the camera then said it was."""

    def leave_nothing_automatic(self) -> list[str]:
        """Switch off what would change counts by itself, where there is such a thing.

        Returns what could not be made neutral, in words.
        """
        for wish, value in _AUTOMATICS:
            if v4l2.control(self._descriptor, wish.number) is not None:
                self.set(wish, value)
        return self._linear_gamma()

    def _linear_gamma(self) -> list[str]:
        gamma = v4l2.control(self._descriptor, v4l2.GAMMA)
        if gamma is None:
            return []
        if not gamma.least <= _LINEAR <= gamma.greatest:
            span = f"{gamma.least} to {gamma.greatest}"
            return [f"gamma of unknown scale ({span}) left at {gamma.value}"]
        self.set(_GAMMA, _LINEAR)
        return []

    def check_range(self, wish: Wish, *values: int) -> v4l2.Control:
        """The control; an error when it is missing or does not allow one of the values."""
        one = v4l2.control(self._descriptor, wish.number)
        if one is None:
            self._check_presence()
            raise DeviceError(
                f"{self._who}: {wish.words} {wish.text(values[0])} asked for, but the camera has "
                "no such control; leave it out of the rig file, or use another camera"
            )
        for value in values:
            if not one.least <= value <= one.greatest:
                raise DeviceError(
                    f"{self._who}: {wish.words} {wish.text(value)} asked for; the camera allows "
                    f"{_range(one, wish)}; change the rig file"
                )
        return one

    def set(self, wish: Wish, value: int) -> int:
        """Set a control and read it back; anything but exactly this value is an error."""
        one = self.check_range(wish, value)
        asked = f"{self._who}: {wish.words} {wish.text(value)} asked for"
        try:
            v4l2.set_control(self._descriptor, one.number, value)
        except OSError as error:
            self._check_presence()
            raise DeviceError(
                f"{asked}; the camera refused it ({os.strerror(error.errno or 0)}) although it "
                f"allows {_range(one, wish)}; look whether another program uses the camera, "
                "or plug it in anew"
            ) from error
        found = v4l2.control_value(self._descriptor, one.number)
        if found != value:
            raise DeviceError(
                f"{asked}, the camera took {wish.text(found)}; it says that it allows "
                f"{_range(one, wish)}; ask for what the camera can do"
            )
        self.read_back[wish.words] = wish.text(found)
        return found

    def _check_presence(self) -> None:
        """An OSError of its own when it is the camera, not the control, that is missing."""
        v4l2.capability(self._descriptor)


def _range(one: v4l2.Control, wish: Wish) -> str:
    span = f"{wish.text(one.least)} to {wish.text(one.greatest)}"
    return f"{span} in steps of {wish.text(one.step)}"
