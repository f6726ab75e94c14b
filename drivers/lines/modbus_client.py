"""pymodbus' blocking clients with prompt reads and a deadline for each request.

pymodbus' own `recv` polls a serial port every millisecond and may wait several time-outs.
"""

from __future__ import annotations

import logging
import select
import socket
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias
from urllib.parse import urlsplit

import serial
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusIOException

from drivers.lines.device_lock import unlock
from drivers.lines.serial_line import ECHO, WRITE_S
from instrument.clock import Clock
from instrument.devices import REPLY_S
from instrument.errors import InputError

READ = b"\x03"  # function code: read holding registers
logging.getLogger("pymodbus").addHandler(logging.NullHandler())  # errors are raised, not printed
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class BusSettings:
    """Address of the line: a serial device's path, or `tcp://host:port` of a gateway.

    `reply_s`: time allowed for an answer, in seconds. Pseudo-terminals support only parity N.
    """

    port: str
    baudrate: int = 115200
    parity: Literal["E", "N", "O"] = "E"
    reply_s: float = REPLY_S


class _DeadlineClient:
    """Reads return as soon as bytes arrive, and at the deadline at the latest."""

    clock: Clock
    deadline_s = 0.0
    received = b""
    socket: Any  # pymodbus' name for what is open: a serial port or a socket

    def close(self) -> None:
        """Close the connection; safe to call twice."""
        port, self.socket = self.socket, None
        if port is not None:
            unlock(port)
            port.close()

    def recv(self, _size: int | None) -> bytes:
        """Return the bytes that arrive before the deadline, however many."""
        data = self.listen(self.deadline_s - self.clock.now_s())
        self.received += data
        return data

    def listen(self, seconds: float) -> bytes:
        """Return the bytes that arrive within `seconds`, or none."""
        port = self.socket
        ready = port is not None and _ready(port.fileno(), seconds)
        return self._read(port) if ready else b""

    @abstractmethod
    def _read(self, port: Any) -> bytes:
        """Return the bytes that have arrived."""


class SerialClient(_DeadlineClient, ModbusSerialClient):
    """Modbus RTU over a serial port.

    A two-wire adapter may return each request. Only the answer to a read can be told from its
    request, so reads show whether there is an echo: an echoed write looks like its answer.
    """

    echoes = False
    sent = b""
    _held = b""
    _may_be_echo = False

    def connect(self) -> bool:
        """Open the port unless it is open; raise the system's error if that fails."""
        if self.socket is None:
            how = self.comm_params
            self.socket = serial.serial_for_url(
                how.host, baudrate=how.baudrate, parity=how.parity, timeout=0,
                write_timeout=WRITE_S, exclusive=True,
            )  # fmt: skip
        return True

    def send(self, request: bytes, addr: tuple[str, int] | None = None) -> int:
        """Send a request; a line that does not take it is as one that does not answer."""
        del addr  # of a datagram
        self.sent, self._held = request, b""
        self._may_be_echo = self.echoes or request[1:2] == READ
        try:
            return int(self.socket.write(request) or 0)
        except serial.SerialTimeoutException as error:
            raise ModbusIOException(f"not taken within {WRITE_S:g} s") from error

    def recv(self, size: int | None) -> bytes:
        """Return the bytes that arrive before the deadline, without the echo of the request."""
        while data := super().recv(size):
            answer = self._without_echo(data) if self._may_be_echo else data
            if answer:
                return answer
        return b""

    def _without_echo(self, data: bytes) -> bytes:
        self._held += data
        if not self._held.startswith(self.sent) and self.sent.startswith(self._held):
            return b""  # perhaps the beginning of an echo
        self._may_be_echo, echo = False, self._held.startswith(self.sent)
        if echo and not self.echoes:
            log.warning("%s %s", self.comm_params.host, ECHO)
        self.echoes = echo
        return self._held[len(self.sent) :] if echo else self._held

    def _read(self, port: Any) -> bytes:
        return bytes(port.read(port.in_waiting or 1))


class TcpClient(_DeadlineClient, ModbusTcpClient):
    """Modbus TCP; a connection that the gateway has closed is an error."""

    def connect(self) -> bool:
        """Connect unless connected; raise the system's error if that fails."""
        if self.socket is None:
            how = self.comm_params
            self.socket = socket.create_connection((how.host, how.port), how.timeout_connect)
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return True

    def _read(self, port: Any) -> bytes:
        data = bytes(port.recv(4096))
        if not data:
            raise ConnectionException("closed by the gateway")
        return data


Client: TypeAlias = SerialClient | TcpClient


def client_for(settings: BusSettings, clock: Clock) -> Client:
    """Return a client for the line, not yet open; pymodbus' own retries are off."""
    client: Client
    if settings.port.startswith("tcp://"):
        host, port = _tcp_address(settings.port)
        client = TcpClient(host, port=port, timeout=settings.reply_s, retries=0)
    else:
        client = SerialClient(
            settings.port, baudrate=settings.baudrate, parity=settings.parity,
            timeout=settings.reply_s, retries=0,
        )  # fmt: skip
    client.clock = clock
    return client


def _tcp_address(address: str) -> tuple[str, int]:
    try:
        url = urlsplit(address)
        host, port = url.hostname, url.port
    except ValueError:
        host, port = None, None
    if not host:
        raise InputError(f"{address}: not an address: write tcp://host:port")
    return host, port or 502


def _ready(descriptor: int, seconds: float) -> bool:
    return bool(select.select([descriptor], [], [], max(seconds, 0.0))[0])
