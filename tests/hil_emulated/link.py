"""Calls from the emulated computer to the bench on its host, over TCP."""

from __future__ import annotations

import os
import threading
from multiprocessing.connection import Client, Connection, Listener
from typing import Any

from instrument.closeable import Closeable

ADDRESS = "GONIO_EMULATED_BENCH"  # environment variable in the guest: host:port
_KEY = b"emulated bench"  # not a secret: only this machine can connect


class BenchServer(Closeable):
    """Carries out the methods of `bench` that a guest calls by name."""

    def __init__(self, bench: object) -> None:
        self._bench = bench
        self._listener = Listener(("127.0.0.1", 0), authkey=_KEY)
        self.port: int = self._listener.address[1]
        threading.Thread(target=self._serve, daemon=True, name="bench server").start()

    def close(self) -> None:
        """Accept no more calls."""
        self._listener.close()

    def _serve(self) -> None:
        while True:
            try:
                connection = self._listener.accept()
            except OSError:
                return  # closed
            threading.Thread(target=self._answer, args=(connection,), daemon=True).start()

    def _answer(self, connection: Connection) -> None:
        while True:
            try:
                name, arguments, named = connection.recv()
            except EOFError:
                return
            try:
                connection.send((getattr(self._bench, name)(*arguments, **named), None))
            except Exception as error:  # noqa: BLE001  # it belongs to the caller
                connection.send((None, f"{type(error).__name__}: {error}"))


class Bench:
    """The host's bench, as the guest calls it: `bench.unplug("AZ")`."""

    def __init__(self, connection: Connection) -> None:
        self._connection, self._lock = connection, threading.Lock()

    @classmethod
    def connected(cls) -> Bench:
        """Connect by the address in the environment; raise `KeyError` outside the guest."""
        host, port = os.environ[ADDRESS].split(":")
        return cls(Client((host, int(port)), authkey=_KEY))

    def __getattr__(self, name: str) -> Any:
        def call(*arguments: Any, **named: Any) -> Any:
            with self._lock:
                self._connection.send((name, arguments, named))
                result, error = self._connection.recv()
            if error is not None:
                raise RuntimeError(error)
            return result

        return call
