"""Transfers of an imported device: exactly one answer for each, whatever is withdrawn when."""

from __future__ import annotations

import errno
import random
import threading
from collections.abc import Iterator

import pytest

from sim.emulated.usb import descriptors, usbip
from sim.emulated.usb.descriptors import BULK, IN, DeviceIdentity
from sim.emulated.usb.device import Stall, UsbDevice
from sim.emulated.usb.server import UsbIpServer
from sim.emulated.usb.usbip import Submitted, Unlinked
from tests.support.usb.usbip_client import UsbIpClient, imported

SOURCE, SINK = IN | 1, 2


class Echo(UsbDevice):
    """Device whose IN endpoint is written by the test, and which keeps what it receives."""

    def __init__(self) -> None:
        parts = [
            descriptors.endpoint(bEndpointAddress=a, bmAttributes=BULK, wMaxPacketSize=512)
            for a in (SOURCE, SINK)
        ]
        interface = descriptors.interface(bInterfaceNumber=0, bNumEndpoints=2, kind=(0xFF, 0, 0))
        configuration = descriptors.configuration(interface, *parts, bNumInterfaces=1)
        identity = DeviceIdentity("Maker", "Echo", "1", 0x0003)
        super().__init__(identity, configuration, usbip.HIGH_SPEED)
        self.received: list[bytes] = []
        self.stopped: list[int] = []

    def receive(self, endpoint: int, data: bytes) -> None:
        assert endpoint == SINK
        self.received.append(data)

    def stop_endpoint(self, endpoint: int) -> None:
        self.stopped.append(endpoint)


@pytest.fixture
def echo() -> Echo:
    return Echo()


@pytest.fixture
def client(echo: Echo) -> Iterator[UsbIpClient]:
    with UsbIpServer({"1-1": echo}) as server, imported(server.port) as one:
        yield one


def test_bytes_fill_transfers_and_the_last_one_ends_short(echo: Echo, client: UsbIpClient) -> None:
    numbers = [client.submit(SOURCE, 4) for _ in range(3)]
    client.control_in(0, 0, 0, 0, 2)  # the transfers have arrived
    assert echo.cable is not None
    assert echo.cable.awaited(SOURCE)
    assert echo.cable.send(SOURCE, b"abcdefghij")
    replies = [client.reply() for _ in numbers]
    assert replies == [
        Submitted(n, 0, len(piece), piece)
        for n, piece in zip(numbers, (b"abcd", b"efgh", b"ij"), strict=True)
    ]
    assert not echo.cable.awaited(SOURCE)


def test_out_transfers_arrive_in_order(echo: Echo, client: UsbIpClient) -> None:
    sent = [bytes([i]) * i for i in range(20)]
    for number, data in [(client.submit(SINK, len(d), d), d) for d in sent]:
        assert client.reply() == Submitted(number, 0, len(data))
    assert echo.received == sent


def test_a_send_waits_for_the_next_transfer_and_gives_up_when_told(
    echo: Echo, client: UsbIpClient
) -> None:
    wanted = [True]
    sent: list[bool] = []
    cable = echo.cable
    assert cable is not None

    def send() -> None:
        sent.extend(cable.send(SOURCE, b"x", lambda: wanted[0]) for _ in range(2))

    thread = threading.Thread(target=send)
    thread.start()
    assert client.reply_to(client.submit(SOURCE, 1)) == Submitted(1, 0, 1, b"x")
    wanted[0] = False
    cable.wake()
    thread.join(20)
    assert sent == [True, False]
    number = client.submit(SOURCE, 1)
    assert client.reply_to(client.unlink(number)) == Unlinked(number + 1, -errno.ECONNRESET)


@pytest.mark.parametrize("seed", range(3))
def test_each_transfer_is_completed_or_withdrawn_never_both(
    seed: int, echo: Echo, client: UsbIpClient
) -> None:
    """A RET_UNLINK of -ECONNRESET excludes a RET_SUBMIT; one of 0 follows it (the document)."""
    drawn = random.Random(seed)
    cable = echo.cable
    assert cable is not None
    ending = threading.Event()

    def feed() -> None:
        while cable.send(SOURCE, b"data", lambda: not ending.is_set()):
            pass

    feeder = threading.Thread(target=feed)
    feeder.start()
    unlinks = {}
    submitted = []
    for _ in range(300):
        number = client.submit(SOURCE, 16)
        submitted.append(number)
        if drawn.random() < 0.5:
            victim = drawn.choice(submitted[-3:])
            if victim not in unlinks.values():
                unlinks[client.unlink(victim)] = victim
    last = client.unlink(0)
    completed, withdrawn = set(), set()
    answered = False
    while not answered or len(completed | withdrawn) < 300:
        reply = client.reply()
        answered |= reply.seqnum == last
        if isinstance(reply, Submitted):
            assert reply.seqnum not in completed | withdrawn
            completed.add(reply.seqnum)
        elif reply.seqnum != last:
            victim = unlinks[reply.seqnum]
            assert (reply.status == 0) == (victim in completed)
            withdrawn |= {victim} if reply.status else set()
    ending.set()
    cable.wake()
    feeder.join(20)
    assert completed | withdrawn == set(submitted)
    assert not completed & withdrawn
    assert completed


def test_an_unlink_that_overtakes_its_transfer(echo: Echo, client: UsbIpClient) -> None:
    """Seen with Linux 6.1: answered when the transfer arrives, which is then not carried out."""
    early = client.unlink(3)
    assert client.control_in(0, 0, 0, 0, 2) == b"\0\0"  # transfer 2, not concerned
    assert client.submit(SINK, 1, b"x") == 3
    assert client.reply() == Unlinked(early, -errno.ECONNRESET)
    later = client.submit(SINK, 1, b"y")
    assert client.reply() == Submitted(later, 0, 1)
    assert echo.received == [b"y"]


def test_a_halted_endpoint_stalls_until_it_is_cleared(echo: Echo, client: UsbIpClient) -> None:
    client.control_out(0x02, 3, 0, SINK)  # SET_FEATURE(ENDPOINT_HALT)
    assert client.control_in(0x02, 0, 0, SINK, 2) == b"\1\0"
    refused = client.reply_to(client.submit(SINK, 1, b"x"))
    assert refused == Submitted(refused.seqnum, -errno.EPIPE, 0)
    client.control_out(0x02, 1, 0, SINK)
    assert client.control_in(0x02, 0, 0, SINK, 2) == b"\0\0"
    taken = client.reply_to(client.submit(SINK, 1, b"y"))
    assert taken == Submitted(taken.seqnum, 0, 1)
    assert echo.received == [b"y"]
    assert echo.stopped == [SINK, SINK]


def test_an_endpoint_that_does_not_exist_stalls(client: UsbIpClient) -> None:
    for address in (IN | 5, 6):
        number = client.submit(address, 1, b"" if address & IN else b"x")
        assert client.reply_to(number) == Submitted(number, -errno.EPIPE, 0)


def test_a_pulled_cable_ends_a_send(echo: Echo, client: UsbIpClient) -> None:
    cable = echo.cable
    assert cable is not None
    sent: list[bool] = []
    thread = threading.Thread(target=lambda: sent.append(cable.send(SOURCE, b"x")))
    thread.start()
    cable.pull()
    thread.join(20)
    assert sent == [False]
    with pytest.raises((EOFError, OSError)):
        client.reply()


def test_a_control_transfer_stalls_and_the_next_succeeds(client: UsbIpClient) -> None:
    with pytest.raises(Stall):
        client.control_in(0, 6, 6 << 8, 0, 10)  # device qualifier
    assert len(client.control_in(0, 6, 1 << 8, 0, 64)) == 18
