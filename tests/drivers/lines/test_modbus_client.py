"""Modbus clients: invalid addresses are refused."""

from __future__ import annotations

import pytest

from drivers.lines.modbus_client import BusSettings, client_for
from instrument.clock import SystemClock
from instrument.errors import InputError


@pytest.mark.parametrize("port", ["tcp://", "tcp://host:high"])
def test_an_invalid_address_is_refused(port: str) -> None:
    with pytest.raises(InputError, match=port):
        client_for(BusSettings(port), SystemClock())
