"""List of the V4L2 cameras and their capabilities, read without starting a stream."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from drivers.v4l2 import ioctl
from instrument.errors import DeviceError


def video_devices(root: Path = Path("/dev")) -> list[str]:
    """Return the paths in v4l/by-id, which survive unplugging, or else those of video*."""
    by_id = sorted(str(path) for path in root.glob("v4l/by-id/*"))
    numbered = (path for path in root.glob("video*") if path.name[5:].isdigit())
    return by_id or [str(path) for path in sorted(numbered, key=lambda p: int(p.name[5:]))]


def describe(device: str) -> str:
    """Return one line for the device, one per format and one per control.

    The camera may be in use: nothing is changed.
    """
    try:
        with ioctl.opened(device) as descriptor:
            return "\n".join(_lines(device, descriptor))
    except OSError as error:
        raise DeviceError(
            f"camera {device}: does not answer as a V4L2 capture device "
            f"({os.strerror(error.errno or 0)}); look at its cable, and that you may read "
            "and write it (group video)"
        ) from error


def _lines(device: str, descriptor: int) -> Iterator[str]:
    c = ioctl.capability(descriptor)
    yield f"  {device}: {c.card} ({c.driver}, {c.bus})"
    for name in ioctl.formats(descriptor):
        yield f"    {name}: {', '.join(ioctl.sizes(descriptor, name)) or 'any size'}"
    for control in ioctl.controls(descriptor):
        span = f"{control.minimum} to {control.maximum} in steps of {control.step}"
        yield f"    {control.name} ({control.kind}): {control.value}; {span}"
