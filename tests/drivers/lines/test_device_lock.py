"""One program at a time opens a device; the other is told who has it."""

from __future__ import annotations

import contextlib
import logging
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
import serial

from drivers.factory import Lines
from drivers.lines import device_lock
from drivers.lines.device_lock import DeviceInUse, DeviceLock
from drivers.lines.modbus_bus import ModbusBus
from drivers.lines.modbus_client import BusSettings, SerialClient, client_for
from drivers.lines.serial_line import Line, PortClosed, PortGone
from instrument.clock import SystemClock
from sim.emulated.wire import PtyWire
from tests.support.paths import ROOT
from tests.support.timing.deadline import wait_for
from tests.support.usb.left_behind import open_descriptors

HOLD = """
import sys
from pathlib import Path
from drivers.lines import device_lock
device_lock._FOLDERS = (Path(sys.argv[2]),)
with device_lock.DeviceLock("axis", sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is left behind in the machine's folder for locks."""
    monkeypatch.setattr(device_lock, "_FOLDERS", (tmp_path,))


@contextmanager
def held_by_another(device: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, device, str(folder)], cwd=ROOT, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as other:  # fmt: skip
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        try:
            yield other
        finally:
            other.kill()


def test_a_device_that_another_program_has_is_refused_with_its_name(tmp_path: Path) -> None:
    device = f"tcp://{tmp_path.name}:502"
    with held_by_another(device, tmp_path) as other:
        pattern = rf"theta_r: {device} is in use by process {other.pid} \(.*\): wait for its end"
        with pytest.raises(DeviceInUse, match=pattern):
            DeviceLock("theta_r", device)
        DeviceLock("theta_r", f"{device}0").close()  # another device
    with DeviceLock("theta_r", device), pytest.raises(DeviceInUse, match="this program, which"):
        DeviceLock("dphi", device.upper().replace("TCP", "tcp"))
    DeviceLock("theta_r", device).close()


def test_a_second_program_sends_nothing_to_a_gateway(tmp_path: Path) -> None:
    """Nobody listens there: to have tried would be another error."""
    gateway = f"tcp://localhost.{tmp_path.name}:502"
    with (
        held_by_another(gateway, tmp_path),
        Lines(SystemClock()) as lines,
        pytest.raises(DeviceInUse, match="nothing was sent to the device"),
    ):
        lines.modbus("theta_r", BusSettings(gateway))


def test_a_port_that_does_not_open_is_free_again(tmp_path: Path) -> None:
    port = str(tmp_path / "nobody")
    (tmp_path / "nobody").touch()
    with Lines(SystemClock()) as lines:
        for _ in range(2):
            with pytest.raises(Exception, match="cannot open"):
                lines.serial("theta_r", port, 57600, 0.15)


@pytest.fixture
def port() -> Iterator[str]:
    """A serial port at which nothing answers."""
    with PtyWire([]) as wire:
        yield wire.port


def open_line(port: str) -> Line:
    return Line("theta_r", port, 57600, SystemClock())


def open_bus(port: str) -> SerialClient:
    client = client_for(BusSettings(port, parity="N"), SystemClock())
    assert client.connect()
    assert isinstance(client, SerialClient)
    return client


@pytest.mark.parametrize("opened", [open_line, open_bus])
def test_a_closed_port_is_free_though_a_thread_still_waits_for_its_bytes(
    port: str, opened: Callable[[str], Line | SerialClient]
) -> None:
    """A copy of its descriptor stands for that thread: the system keeps the port open for both."""
    line = opened(port)
    with pytest.raises(OSError, match="exclusively lock"):
        serial.Serial(port, exclusive=True)
    copies = [os.dup(int(number)) for number, target in open_descriptors() if target == port]
    line.close()
    opened(port).close()
    for copy in copies:
        os.close(copy)


def test_a_line_that_is_closed_while_it_is_opened_anew_keeps_no_port(
    port: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    line, open_port = open_line(port), serial.serial_for_url
    closing = threading.Thread(target=line.close)
    with monkeypatch.context() as patched:
        patched.setattr(serial.Serial, "write", Mock(side_effect=OSError("unplugged")))
        with pytest.raises(PortGone):
            line.write(b"1TS")

    def open_and_close(*args: Any, **options: Any) -> serial.Serial:
        closing.start()
        wait_for(lambda: "closed by this program" in error_of_writing(line), "the closing")
        return open_port(*args, **options)

    monkeypatch.setattr(serial, "serial_for_url", open_and_close)
    with contextlib.suppress(PortClosed):  # unless the stop was sent before
        line.write_at_once(b"1ST")
    closing.join(timeout=5.0)
    serial.Serial(port, exclusive=True).close()


def test_a_bus_that_is_closed_while_it_is_opened_anew_keeps_no_port(
    port: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = ModbusBus("theta_r", BusSettings(port, parity="N"), SystemClock())
    open_port = serial.serial_for_url
    with monkeypatch.context() as patched:
        patched.setattr(serial.Serial, "fileno", Mock(side_effect=OSError("unplugged")))
        with pytest.raises(PortGone, match="unplugged"):
            bus.exchange("theta_r", lambda client: client.listen(0.0))

    def open_and_close(*args: Any, **options: Any) -> serial.Serial:
        opened = open_port(*args, **options)
        bus.close()
        return opened

    monkeypatch.setattr(serial, "serial_for_url", open_and_close)
    with pytest.raises(PortClosed):
        bus.open("theta_r", at_any_path=True)
    serial.Serial(port, exclusive=True).close()


def error_of_writing(line: Line) -> str:
    with pytest.raises(PortGone) as raised:
        line.write(b"")
    return str(raised.value)


def test_without_a_place_for_locks_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(device_lock, "_FOLDERS", (tmp_path / "nowhere",))
    with caplog.at_level(logging.WARNING), DeviceLock("theta_r", "/dev/null"):
        assert "/dev/null: another program that uses it would not be noticed" in caplog.text


def test_a_link_in_place_of_the_lock_is_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder is open to all users."""
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    target = tmp_path / "target"
    (first / "gonio-port.lock").symlink_to(target)
    monkeypatch.setattr(device_lock, "_FOLDERS", (first, second))
    with DeviceLock("theta_r", "port"):
        assert not target.exists()
        assert (second / "gonio-port.lock").exists()


def test_a_path_at_which_there_is_nothing_needs_no_lock(tmp_path: Path) -> None:
    """An emulated camera is seen by its own process only, under the same path in each."""
    path = str(tmp_path / "camera")
    with DeviceLock("camera", path), DeviceLock("camera", path):
        assert list(tmp_path.iterdir()) == []
