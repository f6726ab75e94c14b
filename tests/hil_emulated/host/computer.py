"""Emulated computer: qemu without hardware virtualisation, USB serial adapters on host sockets."""

from __future__ import annotations

import json
import socket
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from instrument.closeable import Closeable
from tests.hil_emulated.host.kernel import Kernel

HOST = "10.0.2.2"  # the host's address as the guest sees it: qemu(1), -netdev user
_MEMORY_MB = 3072
_PROCESSOR = "Nehalem"  # without AVX: in qemu 7.2 NumPy's sorts crash with it
_COMMAND_LINE = (
    "console=ttyS0 panic=-1 quiet mitigations=off tsc=reliable random.trust_cpu=on net.ifnames=0"
)


class Computer(Closeable):
    """A running guest; its console is this process's standard output.

    `adapters`: sockets of the USB serial adapters' far ends, by serial number; somebody listens on
    each already. `out`: folder that host and guest share, mounted at /out.
    """

    def __init__(
        self, kernel: Kernel, initrd: Path, out: Path, adapters: Mapping[str, Path], folder: Path
    ) -> None:
        self._monitor_path = folder / "monitor"
        options = [
            *_machine(kernel, initrd), *_shared("host_root", Path("/"), readonly=True),
            *_shared("host_out", out), *_network(), "-device", "qemu-xhci,id=usb",
            "-qmp", f"unix:{self._monitor_path},server=on,wait=off",
        ]  # fmt: skip
        for name, path in adapters.items():
            options += ["-chardev", f"socket,id={name},path={path},reconnect=1"]
            options += ["-device", json.dumps(_adapter(name))]
        self._process = subprocess.Popen(options, stdin=subprocess.DEVNULL)

    def wait(self, timeout_s: float) -> None:
        """Wait until the guest has powered off; raise `subprocess.TimeoutExpired` if it does not.

        A guest that crashed ends at once too: nothing restarts it.
        """
        self._process.wait(timeout_s)

    def close(self) -> None:
        """Cut the power, if it is still on."""
        self._process.kill()
        self._process.wait()

    def unplug(self, name: str) -> None:
        """Pull the plug of a USB serial adapter."""
        self._monitor("device_del", id=f"adapter_{name}")

    def plug(self, name: str) -> None:
        """Plug a USB serial adapter in again."""
        self._monitor("device_add", **_adapter(name))

    def _monitor(self, command: str, **arguments: Any) -> None:
        """Carry out one command of the QEMU Machine Protocol."""
        with socket.socket(socket.AF_UNIX) as monitor:
            monitor.connect(str(self._monitor_path))
            lines = monitor.makefile("rw")
            lines.readline()  # greeting
            for name, values in (("qmp_capabilities", {}), (command, arguments)):
                lines.write(json.dumps({"execute": name, "arguments": values}) + "\n")
                lines.flush()
                answer: dict[str, Any] = {"event": ""}
                while "event" in answer:
                    answer = json.loads(lines.readline())
                if "error" in answer:
                    raise RuntimeError(f"qemu: {command} {arguments}: {answer['error']['desc']}")


def _machine(kernel: Kernel, initrd: Path) -> list[str]:
    return [
        "qemu-system-x86_64", "-machine", "q35", "-accel", "tcg,thread=multi", "-cpu", _PROCESSOR,
        "-smp", "2", "-m", str(_MEMORY_MB), "-nodefaults", "-no-user-config", "-no-reboot",
        "-display", "none", "-serial", "stdio", "-kernel", str(kernel.image),
        "-initrd", str(initrd), "-append", _COMMAND_LINE,
    ]  # fmt: skip


def _shared(tag: str, folder: Path, readonly: bool = False) -> list[str]:
    """Share a folder of the host by 9p; one that spans file systems keeps its files apart."""
    more = ",readonly=on,multidevs=remap" if readonly else ""
    return [
        "-fsdev", f"local,id={tag},path={folder},security_model=none{more}",
        "-device", f"virtio-9p-pci,fsdev={tag},mount_tag={tag}",
    ]  # fmt: skip


def _network() -> list[str]:
    return ["-netdev", "user,id=net", "-device", "virtio-net-pci,netdev=net,romfile="]


def _adapter(name: str) -> dict[str, Any]:
    """Return an FTDI adapter, as qemu emulates it, with its serial number."""
    return {
        "driver": "usb-serial", "id": f"adapter_{name}", "bus": "usb.0", "chardev": name,
        "always-plugged": True, "serial": name,
    }  # fmt: skip
