"""What hangs on this computer: serial ports, who answers on them, and cameras."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

from drivers.lines.serial_line import Line, NoReply
from instrument.errors import DeviceError

_BY_ID = Path("/dev/serial/by-id")

# What each kind of controller is asked: baud rate, question. Nothing here moves anything.
_QUESTIONS = (
    ("Zaber", 115200, b"/\r\n"),
    ("Newport SMC100", 57600, b"1VE\r\n"),
    ("Newport CONEX-CC", 921600, b"1VE\r\n"),
)


def serial_ports(identify: bool) -> list[str]:
    """A line for each port: its stable name, what it is, and who answered if asked."""
    from serial.tools.list_ports import comports

    stable = {str(link.resolve()): str(link) for link in sorted(_BY_ID.glob("*"))}
    lines = []
    for port in sorted(comports()):
        name = stable.get(port.device, port.device)
        text = f"{name} ({port.device}: {port.description})"
        lines.append(text + (f": {who_answers(name)}" if identify else ""))
    return lines


def who_answers(port: str) -> str:
    """Ask each kind of controller's question and quote the first answer."""
    try:
        return next(_answers(port), "nobody answers")
    except DeviceError as error:
        return str(error)


def _answers(port: str) -> Iterator[str]:
    for kind, baudrate, question in _QUESTIONS:
        with Line(kind, port, baudrate) as line:
            line.write(question)
            try:
                answer = line.read_line(time.monotonic() + line.reply_s, kind)
            except NoReply:
                continue
            yield f"{answer.decode('ascii', 'replace')!r} when asked as {kind}"


def cameras() -> list[str]:
    """A block of text for each camera: formats, sizes, controls with ranges."""
    from drivers.v4l2.listing import describe, video_devices

    return [str(describe(device)) for device in video_devices()]
