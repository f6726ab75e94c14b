"""Boot the emulated computer and run the project's `hil` tests in it: `make hil-emulated`.

The options are pytest's own (`--slow` for whole runs, `-k`, paths of tests). The exit code is that
of pytest in the guest. Where the machine lacks something, one line says so, and nothing is tested.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from instrument.config.load import load_protocol
from tests.hil_emulated.guest.devices import USB
from tests.hil_emulated.host.bench import HostBench
from tests.hil_emulated.host.computer import HOST, Computer
from tests.hil_emulated.host.initrd import write_initrd
from tests.hil_emulated.host.kernel import Kernel, installed_kernel
from tests.hil_emulated.link import ADDRESS, BenchServer
from tests.support.paths import ROOT

_HERE = Path(__file__).parent
_PACKAGES = {  # Debian's names
    "qemu-system-x86_64": "qemu-system-x86", "busybox": "busybox-static", "cpio": "cpio",
    "udevadm": "udev", "kmod": "kmod",
}  # fmt: skip
_PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
_UDEVD = "/lib/systemd/systemd-udevd"
_TESTS = ("tests/drivers/test_camera_contract.py", "tests/drivers/test_stage_contract.py",
          "tests/hil_emulated/guest")  # fmt: skip
_LIMIT_S = 1500.0


def main() -> int:
    """Return pytest's exit code, 0 if the machine lacks something, 70 if the guest crashed."""
    kernel = installed_kernel()
    lacking = _lacking(kernel)
    if lacking or kernel is None:
        _say(f"skipped: {lacking}")
        return 0
    _say(f"Linux {kernel.version}")
    with tempfile.TemporaryDirectory() as folder:
        return _run(kernel, Path(folder), sys.argv[1:])


def _lacking(kernel: Kernel | None) -> str:
    """Return what this machine lacks, in words; empty if it has all."""
    packages = [package for tool, package in _PACKAGES.items() if shutil.which(tool) is None]
    if kernel is None:
        packages.append("linux-image-amd64")
    if packages:
        return f"not installed (Debian: {' '.join(packages)})"
    if kernel is not None and not os.access(kernel.image, os.R_OK):
        return f"{kernel.image} may not be read: run it as root"
    return ""


def _run(kernel: Kernel, folder: Path, options: list[str]) -> int:
    out = folder / "out"
    out.mkdir()
    initrd = write_initrd(kernel, Path(shutil.which("busybox") or ""), folder)
    with (
        HostBench(load_protocol(_HERE / "scan.yaml"), folder) as bench,
        BenchServer(bench) as calls,
    ):
        (out / "start.sh").write_text(_start(options, calls.port, bench.usb.port))
        with Computer(kernel, initrd, out, bench.adapters, folder) as computer:
            bench.computer = computer
            try:
                computer.wait(_LIMIT_S)
            except subprocess.TimeoutExpired:
                _say(f"switched off: not done after {_LIMIT_S:g} s")
    code = out / "exit_code"
    return int(code.read_text()) if code.exists() else 70


def _say(text: str) -> None:
    sys.stdout.write(f"emulated computer: {text}\n")
    sys.stdout.flush()


def _start(options: list[str], calls: int, usb: int) -> str:
    """Return the script that the guest runs once its file system is mounted."""
    paths = [o for o in options if Path(o.split("::")[0]).exists()]
    rest = [o for o in options if o not in paths]
    command = [
        sys.executable, "-m", "pytest", "-v", "-m", "hil", "--allow-motion",
        f"--color={'yes' if sys.stdout.isatty() else 'no'}",
        "-p", "no:cacheprovider", "-p", "tests.hil_emulated.guest.kernel_drivers",
        "--rig", str(_HERE / "rig.yaml"), *rest, *(paths or _TESTS),
    ]  # fmt: skip
    variables = {
        "PATH": _PATH, "HOME": "/root", "LANG": "C.UTF-8",
        "SYSTEMD_IGNORE_CHROOT": "1", "PYTHONDONTWRITEBYTECODE": "1",
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
        ADDRESS: f"{HOST}:{calls}", USB: f"{HOST}:{usb}",
    }  # fmt: skip
    return "\n".join([
        *(f"export {name}={shlex.quote(value)}" for name, value in variables.items()),
        f"{_UDEVD} --daemon; udevadm trigger; udevadm settle --timeout=60",
        f"cd {shlex.quote(str(ROOT))}",
        shlex.join(command),
        "echo $? > /out/exit_code",
    ])  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
