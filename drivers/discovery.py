"""Listing of this computer's serial ports, with the controllers that answer, and of its cameras."""

from __future__ import annotations

import termios
from collections.abc import Iterator
from pathlib import Path

from drivers.lines.serial_line import Line, NoReply
from instrument.clock import SystemClock
from instrument.errors import DeviceError

_BY_ID = Path("/dev/serial/by-id")

# Identification queries of the known controllers: kind, baud rate, query. None starts a motion.
_QUERIES = (
    ("Zaber", 115200, b"/\r\n"),
    ("Newport SMC100", 57600, b"1VE\r\n"),
    ("Newport CONEX-CC", 921600, b"1VE\r\n"),
)


def serial_ports(identify: bool) -> list[str]:
    """Return one line of text per port: its stable name, its description, and what answers."""
    from serial.tools.list_ports import comports

    stable = {str(link.resolve()): str(link) for link in sorted(_BY_ID.glob("*"))}
    lines = []
    for port in sorted(comports()):
        name = stable.get(port.device, port.device)
        text = f"{name} ({port.device}: {port.description})"
        lines.append(text + (f": {identify_controller(name)}" if identify else ""))
    return lines


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
            yield f"{answer.decode('ascii', 'replace')!r} when asked as {kind}"


def cameras() -> list[str]:
    """Return a block of text per camera: formats, sizes, and controls with their ranges."""
    from drivers.v4l2.listing import descriptions, video_devices

    return descriptions(video_devices())
