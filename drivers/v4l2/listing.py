"""What V4L2 cameras there are and what each can do, asked without starting a stream."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from drivers.v4l2 import ioctl as v4l2
from instrument.errors import DeviceError


@dataclass(frozen=True, slots=True)
class OfferedFormat:
    """A pixel format and the sizes that go with it, in words."""

    name: str
    sizes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CameraDescription:
    """What a camera says of itself; `current` is the picture that it is set to."""

    device: str
    capability: v4l2.Capability
    formats: tuple[OfferedFormat, ...]
    controls: tuple[v4l2.Control, ...]
    current: v4l2.Format

    def __str__(self) -> str:
        """For a person: a line for what it is, one a format, one a control."""
        c = self.capability
        lines = [f"  {self.device}: {c.card} ({c.driver}, {c.bus})"]
        for offered in self.formats:
            sizes = ", ".join(offered.sizes)
            lines.append(f"    {offered.name}: {sizes or 'any size'}")
        for control in self.controls:
            span = f"{control.least} to {control.greatest} in steps of {control.step}"
            lines.append(f"    {control.name} ({control.kind}): {control.value}; {span}")
        return "\n".join(lines)


def video_devices(root: Path = Path("/dev")) -> list[str]:
    """Device paths: those of v4l/by-id, which outlast unplugging; without any, those of video*."""
    by_id = sorted(str(path) for path in root.glob("v4l/by-id/*"))
    numbered = (path for path in root.glob("video*") if path.name[5:].isdigit())
    return by_id or [str(path) for path in sorted(numbered, key=lambda p: int(p.name[5:]))]


def describe(device: str) -> CameraDescription:
    """Ask a camera what it is and can do. It need not be free: nothing is changed."""
    try:
        with v4l2.opened(device) as descriptor:
            return _description(device, descriptor)
    except OSError as error:
        raise DeviceError(
            f"camera {device}: does not answer as a V4L2 capture device "
            f"({os.strerror(error.errno or 0)}); look at its cable, and that you may read "
            "and write it (group video)"
        ) from error


def _description(device: str, descriptor: int) -> CameraDescription:
    offered = [
        OfferedFormat(name, tuple(v4l2.sizes(descriptor, name)))
        for name in v4l2.formats(descriptor)
    ]
    return CameraDescription(
        device,
        v4l2.capability(descriptor),
        tuple(offered),
        tuple(v4l2.controls(descriptor)),
        v4l2.current_format(descriptor),
    )
