"""Linux kernel of the emulated computer: found among those installed, never written down."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# Drivers under test, and what the emulated computer itself is made of. vivid is loaded by its own
# tests: it makes a camera as soon as it is there.
ON_REQUEST = ("vivid",)
_AT_BOOT = (
    "virtio_pci", "virtio_net", "9p", "9pnet_virtio", "overlay", "xhci_pci",
    "uvcvideo", "vhci_hcd", "cdc_acm", "ftdi_sio",
)  # fmt: skip


@dataclass(frozen=True)
class Kernel:
    """Image and folder of modules of one version."""

    version: str
    image: Path
    modules: Path

    def load_order(self, wanted: tuple[str, ...] = (*_AT_BOOT, *ON_REQUEST)) -> list[Path]:
        """Return the files of these modules, each after those that it needs.

        Raises `LookupError` for a module that this kernel neither has nor has built in.
        """
        files, needs = _dependencies((self.modules / "modules.dep").read_text())
        built_in = set(map(_name, (self.modules / "modules.builtin").read_text().split()))
        order: dict[str, Path] = {}

        def add(name: str) -> None:
            if name in built_in or name in order:
                return
            for needed in needs[name]:
                add(needed)
            order[name] = self.modules / files[name]

        for name in wanted:
            add(name)
        return list(order.values())


def installed_kernel(
    boot: Path = Path("/boot"), modules: Path = Path("/lib/modules")
) -> Kernel | None:
    """Return the newest installed kernel that has every module, None without any."""
    for kernel in _installed(boot, modules):
        try:
            kernel.load_order()
        except (LookupError, OSError):  # a cloud kernel has no cameras
            continue
        return kernel
    return None


def _installed(boot: Path, modules: Path) -> Iterator[Kernel]:
    images = {p.name.removeprefix("vmlinuz-"): p for p in boot.glob("vmlinuz-*")}
    for version in sorted(images, key=_by_number, reverse=True):
        yield Kernel(version, images[version], modules / version)


def _by_number(version: str) -> list[tuple[int, str]]:
    return [(int(part) if part.isdigit() else -1, part) for part in re.split(r"[.-]", version)]


def _dependencies(text: str) -> tuple[dict[str, str], dict[str, list[str]]]:
    """Return file and needed modules of each module, from the text of modules.dep."""
    files, needs = {}, {}
    for line in text.splitlines():
        file, _, needed = line.partition(":")
        files[_name(file)] = file
        needs[_name(file)] = [_name(path) for path in needed.split()]
    return files, needs


def _name(file: str) -> str:
    return Path(file).name.split(".")[0].replace("-", "_")
