"""Transfers between an emulated device and the computer that imported it, over one connection."""

from __future__ import annotations

import contextlib
import errno
import socket
import threading
from collections import defaultdict, deque
from collections.abc import Callable

from sim.emulated.usb import usbip
from sim.emulated.usb.descriptors import IN
from sim.emulated.usb.device import Setup, Stall, UsbDevice
from sim.emulated.usb.usbip import Submit, Submitted, Unlink, Unlinked


class Link:
    """Cable between a device and one importing computer; `serve` runs until either end pulls it.

    A transfer is completed, or withdrawn by UNLINK, under one lock: the computer gets exactly one
    answer for it. Linux's vhci_tx sends an UNLINK before its SUBMIT if the transfer is withdrawn at
    the moment between the two queues that it empties in turn; such an UNLINK is answered when the
    transfer arrives, because vhci_rx takes the connection for broken if both are answered.
    """

    def __init__(self, connection: socket.socket, device: UsbDevice) -> None:
        self._connection, self._device = connection, device
        self._read = usbip.exactly(connection.recv)
        self._waiting: defaultdict[int, deque[Submit]] = defaultdict(deque)
        self._last_seqnum = 0  # of the transfers: they arrive in order
        self._early_unlinks: dict[int, int] = {}  # number of a transfer to come: of its UNLINK
        self._change = threading.Condition()
        self._pulled = False

    def serve(self, greeting: bytes) -> None:
        """Plug the device in, confirm that, and carry out commands until the link ends."""
        self._device.plug(self)
        try:
            self._connection.sendall(greeting)
            while True:
                command = usbip.read_command(self._read)
                if isinstance(command, Unlink):
                    self._unlink(command)
                else:
                    self._submit(command)
        except (EOFError, OSError):
            pass  # pulled at either end
        finally:
            self.pull()
            self._device.unplug()

    # The device's side

    def send(self, endpoint: int, data: bytes, wanted: Callable[[], bool] = lambda: True) -> bool:
        """Complete transfers of an IN endpoint with these bytes: see `Cable.send`."""
        while True:
            with self._change:
                self._change.wait_for(
                    lambda: self._waiting[endpoint] or self._pulled or not wanted()
                )
                if self._pulled or not wanted():
                    return False
                transfer = self._waiting[endpoint].popleft()
                piece, data = data[: transfer.length], data[transfer.length :]
                self._reply(Submitted(transfer.seqnum, 0, len(piece), piece))
            if not data:
                return True

    def awaited(self, endpoint: int) -> bool:
        """Return True if the computer has a transfer ready for an IN endpoint."""
        with self._change:
            return bool(self._waiting[endpoint])

    def wake(self) -> None:
        """Let all who wait in `send` look at their `wanted()` again."""
        with self._change:
            self._change.notify_all()

    def pull(self) -> None:
        """Disconnect: `serve` and every `send` end."""
        with contextlib.suppress(OSError):  # closed by the other end
            self._connection.shutdown(socket.SHUT_RDWR)  # first, so that a blocked reply ends too
        with self._change:
            self._pulled = True
            self._waiting.clear()
            self._change.notify_all()

    # The computer's side

    def _submit(self, transfer: Submit) -> None:
        self._last_seqnum = transfer.seqnum
        if transfer.seqnum in self._early_unlinks:
            unlink = self._early_unlinks.pop(transfer.seqnum)
            self._reply(Unlinked(unlink, -errno.ECONNRESET))
        else:
            self._carry_out(transfer)

    def _carry_out(self, transfer: Submit) -> None:
        address = transfer.ep | (IN if transfer.direction == usbip.IN else 0)
        try:
            if transfer.ep == 0:
                answer = self._device.control(Setup.parse(transfer.setup), transfer.data)
                self._complete(transfer, answer)
            elif address not in self._device.endpoints or address in self._device.halted:
                raise Stall
            elif address & IN:
                with self._change:
                    self._waiting[address].append(transfer)
                    self._change.notify_all()
            else:
                self._device.receive(address, transfer.data)
                self._complete(transfer, b"")
        except Stall:
            self._reply(Submitted(transfer.seqnum, -errno.EPIPE, 0))

    def _complete(self, transfer: Submit, answer: bytes) -> None:
        if transfer.direction == usbip.OUT:
            self._reply(Submitted(transfer.seqnum, 0, len(transfer.data)))
        else:
            self._reply(Submitted(transfer.seqnum, 0, len(answer), answer[: transfer.length]))

    def _unlink(self, command: Unlink) -> None:
        if command.unlink_seqnum > self._last_seqnum:
            self._early_unlinks[command.unlink_seqnum] = command.seqnum
            return
        with self._change:
            for queue in self._waiting.values():
                for transfer in queue:
                    if transfer.seqnum == command.unlink_seqnum:
                        queue.remove(transfer)
                        self._reply(Unlinked(command.seqnum, -errno.ECONNRESET))
                        return
            self._reply(Unlinked(command.seqnum, 0))

    def _reply(self, reply: Submitted | Unlinked) -> None:
        with self._change, contextlib.suppress(OSError):  # pulled: `serve` notices it too
            self._connection.sendall(usbip.pack_reply(reply))
