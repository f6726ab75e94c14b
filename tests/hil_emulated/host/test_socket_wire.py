"""Far end of a serial adapter: what arrives on the socket is answered by the controller."""

from __future__ import annotations

import socket
import threading
from pathlib import Path

from instrument.clock import SystemClock
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.newport_controller import NewportController
from tests.support.stages.socket_wire import SocketWire, unix_listener


def test_each_connection_is_answered_and_none_outlives_the_wire(tmp_path: Path) -> None:
    before = threading.active_count()
    controller = NewportController(Motor(Mechanics(), SystemClock()))
    with SocketWire([controller], unix_listener(tmp_path / "port")):
        for _ in range(2):  # the computer may be switched off and on
            with socket.socket(socket.AF_UNIX) as port:
                port.settimeout(5)
                port.connect(str(tmp_path / "port"))
                port.sendall(b"1TS\r\n")
                assert port.makefile("rb").readline().startswith(b"1TS0000")
    assert threading.active_count() == before
