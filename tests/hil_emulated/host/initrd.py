"""First file system of the emulated computer: a shell, the kernel's modules, and `init.sh`."""

from __future__ import annotations

import gzip
import lzma
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

from tests.hil_emulated.host.kernel import ON_REQUEST, Kernel

_INIT = Path(__file__).with_name("init.sh")
_FOLDERS = ("bin", "modules", "on_request", "proc", "sys", "dev", "lower", "rw", "newroot")


def write_initrd(kernel: Kernel, busybox: Path, folder: Path) -> Path:
    """Pack the files into a compressed cpio archive in `folder`, and return it."""
    tree = folder / "initrd"
    for name in _FOLDERS:
        (tree / name).mkdir(parents=True)
    shutil.copy(busybox, tree / "bin" / "busybox")
    shutil.copy(_INIT, tree / "init")
    (tree / "init").chmod(0o755)
    _copy_modules(kernel.load_order(), tree)
    names = "\n".join(str(p.relative_to(tree)) for p in sorted(tree.rglob("*")))
    packed = subprocess.run(
        ["cpio", "--quiet", "--create", "--format=newc"],
        input=names.encode(), cwd=tree, stdout=subprocess.PIPE, check=True,
    ).stdout  # fmt: skip
    initrd = folder / "initrd.gz"
    initrd.write_bytes(gzip.compress(packed, compresslevel=1))
    return initrd


def _copy_modules(files: Iterable[Path], tree: Path) -> None:
    """Copy the modules under names that sort in the order in which they are loaded."""
    for number, file in enumerate(files):
        name = file.name.split(".")[0].replace("-", "_")
        late = name in ON_REQUEST
        data = lzma.decompress(file.read_bytes()) if file.suffix == ".xz" else file.read_bytes()
        place = tree / ("on_request" if late else "modules")
        (place / (f"{name}.ko" if late else f"{number:02}_{name}.ko")).write_bytes(data)
