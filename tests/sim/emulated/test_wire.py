"""Pseudo-terminal of an emulated controller: unplugged, and its number."""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path

import pytest

from sim.emulated.wire import Fault, PtyWire
from tests.support.stages.waiting import wait_until

pytestmark = pytest.mark.waits


class Echo:
    """Answers with what it gets."""

    def answer(self, data: bytes) -> bytes:
        return data


def test_the_number_of_an_unplugged_port_goes_to_no_other_device() -> None:
    """Its driver may still try to send a stop, for seconds."""
    with PtyWire([Echo()]) as wire, ExitStack() as others:
        wire.inject(Fault("unplug"))
        line = os.open(wire.port, os.O_RDWR | os.O_NOCTTY)
        os.write(line, b"?")
        wait_until(lambda: not Path(wire.port).exists())
        assert os.read(line, 1) == b""  # hung up
        os.close(line)
        ports = {others.enter_context(PtyWire([Echo()])).port for _ in range(8)}
        assert len(ports) == 8
        assert wire.port not in ports
