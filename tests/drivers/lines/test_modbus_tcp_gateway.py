"""Frames of the emulated Modbus TCP gateway that no device answers."""

from __future__ import annotations

from tests.support.stages.modbus_tcp_gateway import ModbusTcpGateway


def test_a_request_to_an_unknown_unit_gets_exception_0b() -> None:
    """Modbus application protocol V1.1b3, section 7: gateway target device failed to respond."""
    request = bytes.fromhex("0001 0000 0006 07 03 007F 0001")
    assert ModbusTcpGateway([]).answer(request) == bytes.fromhex("0001 0000 0003 07 83 0B")


def test_bytes_of_another_protocol_are_discarded() -> None:
    gateway = ModbusTcpGateway([])
    assert gateway.answer(b"GET / HTTP/1.1\r\n\r\n") == b""
    request = bytes.fromhex("0001 0000 0006 07 03 007F 0001")
    assert gateway.answer(request)[-2:] == bytes.fromhex("83 0B")
