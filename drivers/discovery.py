"""Listing of this computer's serial ports, with the controllers that answer, and of its cameras."""

from __future__ import annotations

import termios
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from drivers.lines.serial_line import Line, NoReply
from instrument.clock import SystemClock
from instrument.errors import DeviceError

if TYPE_CHECKING:
    from drivers.v4l2.listing import FoundCamera

_BY_ID = Path("/dev/serial/by-id")

# Identification queries of the known controllers: kind, baud rate, query. None starts a motion.
_QUERIES = (
    ("Zaber", 115200, b"/\r\n"),
    ("Newport SMC100", 57600, b"1VE\r\n"),
    ("Newport CONEX-CC", 921600, b"1VE\r\n"),
)
_ASKED_AS = " when asked as "


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundPort:
    """Serial port: its stable path, its description, and what answered, empty if nobody asked."""

    path: str
    text: str
    answer: str = ""

    @property
    def driver(self) -> str:
        """Driver of a rig file for the controller that answered; empty if none did."""
        asked_as = self.answer.rpartition(_ASKED_AS)
        return asked_as[2].partition(" ")[0].lower() if asked_as[1] else ""


def found_ports(identify: bool) -> list[FoundPort]:
    """Return the serial ports; `identify`: query each for known controllers. Nothing moves."""
    from serial.tools.list_ports import comports

    stable = {str(link.resolve()): str(link) for link in sorted(_BY_ID.glob("*"))}
    ports = []
    for port in sorted(comports()):
        path = stable.get(port.device, port.device)
        answer = identify_controller(path) if identify else ""
        text = f"{port.device}: {port.description}"
        ports.append(FoundPort(path=path, text=text, answer=answer))
    return ports


def serial_ports(identify: bool) -> list[str]:
    """Return one line of text per port: its stable name, its description, and what answers."""
    return [
        f"{port.path} ({port.text})" + (f": {port.answer}" if port.answer else "")
        for port in found_ports(identify)
    ]


def identify_controller(port: str) -> str:
    """Send each kind's query to a port and quote the first answer."""
    try:
        return next(_answers(port), "no answer")
    except (DeviceError, OSError, termios.error) as error:  # the list goes on
        return str(error)


def _answers(port: str) -> Iterator[str]:
    clock = SystemClock()
    for kind, baudrate, query in _QUERIES:
        with Line(kind, port, baudrate, clock) as line:
            try:
                answer = line.exchange(kind, query, lambda heard: heard or None)
            except NoReply:
                continue
            yield f"{answer.decode('ascii', 'replace')!r}{_ASKED_AS}{kind}"


def cameras() -> list[str]:
    """Return a block of text per camera: formats, sizes, and controls with their ranges."""
    from drivers.v4l2.listing import descriptions, video_devices

    return descriptions(video_devices())


def found_cameras() -> list[FoundCamera]:
    """Return the cameras that answer: formats, sizes and controls."""
    from drivers.v4l2 import listing

    return listing.found_cameras(listing.video_devices())
