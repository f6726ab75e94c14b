"""What can go wrong, and the exit code that scripts see for it.

Every message names the device or file, the value, its unit, what is allowed and what to do next.
"""

from __future__ import annotations


class GonioError(Exception):
    """Base of all errors that the program expects; `exit_code` is what `gonio` returns."""

    exit_code = 1


class InputError(GonioError):
    """A protocol, rig or data file, or a command's argument, is wrong: nothing has moved.

    `problems` holds one line for each mistake, each `file:line:column: path: what`.
    """

    exit_code = 2

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


class DeviceError(GonioError):
    """A device failed: the message says which, what happened and what to look at."""

    exit_code = 3


class CameraLost(DeviceError):
    """The camera is away or gives no frames; its next call looks for it and opens it anew."""


class StorageError(GonioError):
    """The disk does not take what has to be kept: the message says which file and why."""

    exit_code = 3


class OperatorStop(GonioError):
    """The operator stopped the scan (Ctrl-C, or a refused prompt)."""

    exit_code = 4


class NotDetermined(GonioError):
    """The data do not determine what was asked, or are too few for any fit."""

    exit_code = 5
