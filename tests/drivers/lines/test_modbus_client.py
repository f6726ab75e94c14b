"""Modbus clients: invalid addresses are refused, and echoed requests are skipped."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.lines.modbus_client import BusSettings, SerialClient, client_for
from instrument.clock import SystemClock
from instrument.errors import InputError


@pytest.mark.parametrize("port", ["tcp://", "tcp://host:high"])
def test_an_invalid_address_is_refused(port: str) -> None:
    with pytest.raises(InputError, match=port):
        client_for(BusSettings(port), SystemClock())


class Pieces:
    """A port that delivers what comes in pieces."""

    def __init__(self) -> None:
        self.pieces: list[bytes] = []

    def write(self, data: bytes) -> int:
        return len(data)


def received(client: SerialClient, request: bytes, pieces: Sequence[bytes]) -> bytes:
    """What the client takes for the answer to a request, if these pieces come."""
    client.socket.pieces = [piece for piece in pieces if piece]
    client.send(request)
    heard = b""
    while data := client.recv(None):
        heard += data
    return heard


def cut(data: bytes, at: Sequence[int]) -> list[bytes]:
    places = [0, *sorted(place % (len(data) + 1) for place in at), len(data)]
    return [data[a:b] for a, b in pairwise(places)]


CUTS = st.lists(st.integers(0, 1000), max_size=6)


@given(st.integers(0, 0xFF), st.integers(1, 20), st.booleans(), CUTS, st.binary(max_size=3))
def test_an_echo_is_skipped_in_whatever_pieces_it_comes(
    register: int, count: int, echoes: bool, at: list[int], check: bytes
) -> None:
    """A read tells whether there is an echo; the write after it then looks like its answer."""
    client = client_for(BusSettings("wire"), SystemClock())
    assert isinstance(client, SerialClient)
    port = client.socket = Pieces()
    client.listen = lambda _: port.pieces.pop(0) if port.pieces else b""  # type: ignore[method-assign]  # no descriptor
    read = bytes([1, 3, 0, register, 0, count]) + check
    answer = bytes([1, 3, 2 * count, *range(2 * count)])
    assert received(client, read, cut((read if echoes else b"") + answer, at)) == answer
    write = bytes([1, 6, 0, register, 0, count]) + check
    assert received(client, write, cut((write if echoes else b"") + write, at)) == write
    assert received(client, write, [write] if echoes else []) == b""  # the device is dead
