"""List of the V4L2 cameras and their capabilities, read without starting a stream."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from drivers.v4l2 import ioctl
from instrument.errors import DeviceError


@dataclass(frozen=True, slots=True)
class OfferedFormat:
    """A pixel format and the sizes available with it, as text."""

    name: str
    sizes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CameraDescription:
    """Capabilities reported by a camera; `current` is its present image format."""

    device: str
    capability: ioctl.Capability
    formats: tuple[OfferedFormat, ...]
    controls: tuple[ioctl.Control, ...]
    current: ioctl.Format

    def __str__(self) -> str:
        """Return one line for the device, one per format and one per control."""
        c = self.capability
        lines = [f"  {self.device}: {c.card} ({c.driver}, {c.bus})"]
        for offered in self.formats:
            sizes = ", ".join(offered.sizes)
            lines.append(f"    {offered.name}: {sizes or 'any size'}")
        for control in self.controls:
            span = f"{control.minimum} to {control.maximum} in steps of {control.step}"
            lines.append(f"    {control.name} ({control.kind}): {control.value}; {span}")
        return "\n".join(lines)


def video_devices(root: Path = Path("/dev")) -> list[str]:
    """Return the paths in v4l/by-id, which survive unplugging, or else those of video*."""
    by_id = sorted(str(path) for path in root.glob("v4l/by-id/*"))
    numbered = (path for path in root.glob("video*") if path.name[5:].isdigit())
    return by_id or [str(path) for path in sorted(numbered, key=lambda p: int(p.name[5:]))]


def describe(device: str) -> CameraDescription:
    """Read a camera's capabilities. It may be in use: nothing is changed."""
    try:
        with ioctl.opened(device) as descriptor:
            return _description(device, descriptor)
    except OSError as error:
        raise DeviceError(
            f"camera {device}: does not answer as a V4L2 capture device "
            f"({os.strerror(error.errno or 0)}); look at its cable, and that you may read "
            "and write it (group video)"
        ) from error


def _description(device: str, descriptor: int) -> CameraDescription:
    return CameraDescription(
        device=device,
        capability=ioctl.capability(descriptor),
        formats=tuple(
            OfferedFormat(name, tuple(ioctl.sizes(descriptor, name)))
            for name in ioctl.formats(descriptor)
        ),
        controls=tuple(ioctl.controls(descriptor)),
        current=ioctl.current_format(descriptor),
    )
