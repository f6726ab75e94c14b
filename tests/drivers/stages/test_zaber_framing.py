"""Zaber framing against literal bytes from the manual, and against damaged replies."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from drivers.stages import zaber_framing


def test_checksum_of_the_manual() -> None:
    assert zaber_framing.checksum(b"1 0 move abs 10000") == b"41"
    assert zaber_framing.command(1, 1, 7, "home").startswith(b"/1 1 07 home:")


def test_replies_are_parsed() -> None:
    body = b"01 1 07 OK BUSY WR 153600"
    reply = zaber_framing.reply_of(b"@" + body + b":" + zaber_framing.checksum(body))
    assert reply == zaber_framing.Reply(
        device=1, axis=1, message_id=7, accepted=True, busy=True, warning="WR", data="153600",
        checked=True,
    )  # fmt: skip
    assert not zaber_framing.homed([reply.warning])


def test_a_reply_without_a_checksum_is_read_only_if_none_is_required() -> None:
    line = b"@01 0 01 OK IDLE WH 59999"
    assert zaber_framing.reply_of(line) is None
    reply = zaber_framing.reply_of(line, require_checksum=False)
    assert reply is not None
    assert (reply.data, reply.checked) == ("59999", False)
    assert zaber_framing.reply_of(line + b":00", require_checksum=False) is None  # a wrong one


@given(st.binary(max_size=60))
def test_noise_is_no_reply(noise: bytes) -> None:
    assert zaber_framing.reply_of(noise) is None


@given(st.integers(1, 99), st.integers(0, 9), st.integers(0, 99), st.integers(0, 255), st.data())
def test_a_reply_with_one_wrong_byte_is_rejected(
    device: int, axis: int, number: int, change: int, data: st.DataObject
) -> None:
    body = f"{device:02d} {axis} {number:02d} OK IDLE -- 153600".encode()
    line = bytearray(b"@" + body + b":" + zaber_framing.checksum(body))
    at = data.draw(st.integers(1, len(body)))
    if line[at] != change:
        line[at] = change
        assert zaber_framing.reply_of(bytes(line)) is None
