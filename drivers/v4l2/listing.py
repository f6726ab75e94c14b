"""List of the V4L2 cameras and their capabilities, read without starting a stream."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
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


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundCamera:
    """Camera as its driver describes it.

    `purpose`: of a node that delivers no pictures in one plane, empty for one that does. `formats`:
    sizes by pixel format. `limited_range`: that of YUYV, None if another format is set now.
    """

    device: str
    card: str
    driver: str
    bus: str
    purpose: str
    formats: Mapping[str, tuple[str, ...]]
    controls: tuple[ioctl.Control, ...]
    limited_range: bool | None = None

    @property
    def exposure(self) -> ioctl.Control | None:
        """Control of the exposure, in steps of 100 us; None if the camera has none."""
        return self._control(ioctl.EXPOSURE_ABSOLUTE)

    @property
    def gain(self) -> ioctl.Control | None:
        """Control of the gain; None if the camera has none."""
        return self._control(ioctl.GAIN)

    def _control(self, number: int) -> ioctl.Control | None:
        return next((c for c in self.controls if c.number == number), None)

    def lines(self) -> Iterator[str]:
        """Yield one line for the device, one per format and one per control."""
        purpose = f": {self.purpose}" if self.purpose else ""
        yield f"  {self.device}: {self.card} ({self.driver}, {self.bus}){purpose}"
        for name, sizes in self.formats.items():
            yield f"    {name}: {', '.join(sizes) or 'any size'}"
        for control in self.controls:
            span = f"{control.minimum} to {control.maximum} in steps of {control.step}"
            yield f"    {control.name} ({control.kind}): {control.value}; {span}"


def found_cameras(devices: Iterable[str]) -> list[FoundCamera]:
    """Return the cameras that answer and deliver pictures in one plane."""
    found = []
    for device in devices:
        try:
            camera = read_camera(device)
        except DeviceError:
            continue
        if camera is not None and not camera.purpose:
            found.append(camera)
    return found


def describe(device: str) -> str:
    """Return one line for the device, one per format and one per control.

    The camera may be in use: nothing is changed. Empty for a node of another purpose.
    """
    camera = read_camera(device)
    return "" if camera is None else "\n".join(camera.lines())


def read_camera(device: str) -> FoundCamera | None:
    """Return what a device says of itself; None for a node of another purpose.

    The camera may be in use: nothing is changed. Raises `DeviceError` for one that does not answer.
    """
    try:
        with ioctl.opened(device) as descriptor:
            return _camera(device, descriptor)
    except OSError as error:
        raise DeviceError(
            f"camera {device}: does not answer as a V4L2 capture device "
            f"({os.strerror(error.errno or 0)}); look at its cable, and that you may read "
            "and write it (group video)"
        ) from error


def _camera(device: str, descriptor: int) -> FoundCamera | None:
    c = ioctl.capability(descriptor)
    if not c.captures and not c.node & ioctl.MULTI_PLANAR:
        return None
    formats = {n: tuple(ioctl.sizes(descriptor, n)) for n in ioctl.formats(descriptor)}
    return FoundCamera(
        device=device,
        card=c.card,
        driver=c.driver,
        bus=c.bus,
        purpose="" if c.captures else c.purpose,
        formats=formats,
        controls=tuple(ioctl.controls(descriptor)),
        limited_range=_limited_range(descriptor),
    )


def _limited_range(descriptor: int) -> bool | None:
    try:
        now = ioctl.current_format(descriptor)
    except OSError:  # a node with several planes has no such format
        return None
    return now.limited_range if now.name == "YUYV" else None
