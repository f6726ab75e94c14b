"""Exceptions that the program expects, each with the exit code of the command `gonio`.

Every message names the device or file, the value, its unit, what is allowed and what to do next.
"""

from __future__ import annotations


class GonioError(Exception):
    """Base of all expected errors; `exit_code` is the exit code of `gonio`."""

    exit_code = 1


class InputError(GonioError):
    """Mistake in a protocol, rig or data file or in an argument; nothing has moved.

    `problems`: one line for each mistake, `file:line:column: path: what is wrong`.
    """

    exit_code = 2

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


class DeviceError(GonioError):
    """Failure of a device: the message names it, what happened and what to check."""

    exit_code = 3


class ComputerPaused(DeviceError):
    """Computer that ran too little of this program while a stage moved, so that it was stopped.

    No device is at fault: a stage that stands and has its reference may be moved on.
    """


class WrongRigFile(DeviceError):
    """Device that cannot do what the rig file says: a run with this file cannot be resumed."""


class Interlock(DeviceError):
    """Fault that no device reports, seen in what was measured: the scan ends, and may be resumed.

    The message names the interlock, what was seen and expected, and what to look at.
    """


class CameraLost(DeviceError):
    """Camera is gone or sends no frames; the next call to it searches for it and reopens it."""


class StorageError(GonioError):
    """Failure to write a file to disk: the message names the file and the reason."""

    exit_code = 3


class OperatorStop(GonioError):
    """Scan stopped by the operator, by Ctrl-C or by refusing a prompt."""

    exit_code = 4


class NotDetermined(GonioError):
    """Data that do not determine the requested parameters, or are too few for any fit."""

    exit_code = 5


class NoMeasurement(NotDetermined):
    """No point to fit: nothing has been measured yet, or nothing of it is asked for."""


class AllFlagged(NoMeasurement):
    """Scan of which every point is flagged: the rig, the lamp or an interlock spoilt it."""

    exit_code = 3
