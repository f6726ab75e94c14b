"""List of the V4L2 cameras and their capabilities, read without starting a stream."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from drivers.v4l2 import ioctl
from instrument.errors import DeviceError


def video_devices(root: Path = Path("/dev")) -> list[str]:
    """Return the paths in v4l/by-id, which survive unplugging, then the video* not among them."""
    links = sorted(root.glob("v4l/by-id/*"))
    known = {link.resolve() for link in links}
    numbered = (path for path in root.glob("video*") if path.name[5:].isdigit())
    others = sorted(numbered, key=lambda path: int(path.name[5:]))
    return [str(path) for path in (*links, *(o for o in others if o.resolve() not in known))]


def descriptions(devices: Iterable[str]) -> list[str]:
    """Return a block of text per camera, or one line for a device that does not answer.

    Nodes of other purposes (every USB camera has one for metadata) are left out.
    """
    found = []
    for device in devices:
        try:
            found.append(describe(device))
        except DeviceError as error:
            found.append(f"  {device}: FAILED: {error}")
    return [text for text in found if text]


def describe(device: str) -> str:
    """Return one line for the device, one per format and one per control.

    The camera may be in use: nothing is changed. Empty for a node of another purpose.
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
    if not c.captures and not c.node & ioctl.MULTI_PLANAR:
        return
    yield f"  {device}: {c.card} ({c.driver}, {c.bus}){'' if c.captures else f': {c.purpose}'}"
    for name in ioctl.formats(descriptor):
        yield f"    {name}: {', '.join(ioctl.sizes(descriptor, name)) or 'any size'}"
    for control in ioctl.controls(descriptor):
        span = f"{control.minimum} to {control.maximum} in steps of {control.step}"
        yield f"    {control.name} ({control.kind}): {control.value}; {span}"
