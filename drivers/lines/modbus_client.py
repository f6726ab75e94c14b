"""pymodbus' blocking clients, hearing at once and never longer than until their deadline.

pymodbus' own `recv` polls a serial port every millisecond and may wait its time-out several times.
"""

from __future__ import annotations

import logging
import select
import socket
import time
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias
from urllib.parse import urlsplit

import serial
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ConnectionException

from drivers.lines.serial_line import REPLY_S, WRITE_S
from instrument.errors import InputError

logging.getLogger("pymodbus").addHandler(logging.NullHandler())  # errors are raised, not printed


@dataclass(frozen=True, slots=True)
class BusSettings:
    """Where the line is: a serial device's path, or `tcp://host:port` of a gateway.

    `reply_s`: how long a device may take to answer, in seconds. Pseudo-terminals know no parity
    but N.
    """

    port: str
    baudrate: int = 115200
    parity: Literal["E", "N", "O"] = "E"
    reply_s: float = REPLY_S


class _Prompt:
    """Hears at once what comes, and no longer than until its deadline."""

    deadline_s = 0.0
    heard = b""
    socket: Any  # pymodbus' name for what is open: a serial port or a socket

    def close(self) -> None:
        """Let go of it; safe twice."""
        port, self.socket = self.socket, None
        if port is not None:
            port.close()

    def recv(self, _size: int | None) -> bytes:
        """What comes before the deadline, of whatever size."""
        data = self.listen(self.deadline_s - time.monotonic())
        self.heard += data
        return data

    def listen(self, seconds: float) -> bytes:
        """What comes within `seconds`; empty when nothing does."""
        port = self.socket
        ready = port is not None and _ready(port.fileno(), seconds)
        return self._read(port) if ready else b""

    @abstractmethod
    def _read(self, port: Any) -> bytes:
        """What has come."""


class SerialClient(_Prompt, ModbusSerialClient):
    """Over a serial port."""

    def connect(self) -> bool:
        """Open it, if it is not; the error says why it cannot be."""
        if self.socket is None:
            how = self.comm_params
            self.socket = serial.serial_for_url(
                how.host, baudrate=how.baudrate, parity=how.parity, timeout=0,
                write_timeout=WRITE_S, exclusive=True,
            )  # fmt: skip
        return True

    def _read(self, port: Any) -> bytes:
        return bytes(port.read(port.in_waiting or 1))


class TcpClient(_Prompt, ModbusTcpClient):
    """Over a socket; a connection that the gateway has closed is an error."""

    def connect(self) -> bool:
        """Open it, if it is not; the error says why it cannot be."""
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


def client_for(settings: BusSettings) -> Client:
    """A client for the line, not yet open; nothing is ever sent twice by itself."""
    timeout = settings.reply_s
    if not settings.port.startswith("tcp://"):
        return SerialClient(
            settings.port, baudrate=settings.baudrate, parity=settings.parity,
            timeout=timeout, retries=0,
        )  # fmt: skip
    try:
        where = urlsplit(settings.port)
        host, port = where.hostname, where.port
    except ValueError:
        host, port = None, None
    if not host:
        raise InputError(f"{settings.port}: not an address: write tcp://host:port")
    return TcpClient(host, port=port or 502, timeout=timeout, retries=0)


def _ready(descriptor: int, seconds: float) -> bool:
    return bool(select.select([descriptor], [], [], max(seconds, 0.0))[0])
