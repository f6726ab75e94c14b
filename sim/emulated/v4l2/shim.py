"""Build of the preloaded library through which OpenCV opens an emulated camera.

A process uses the library if it is started with `shim_environment(...)`: the dynamic loader reads
LD_PRELOAD only at the start. The camera (`sim.emulated.v4l2.server`) may run in that process or in
another.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from instrument.errors import DeviceError

_SOURCE = Path(__file__).with_name("shim.c")
_OPTIONS = ("-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC")
_PATIENCE_S = 120.0  # it takes about 0.2 s


def compile_shim(folder: Path) -> Path:
    """Compile the library into `folder` and return its path."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise DeviceError(
            "emulated camera: no C compiler: `cc` is not on the PATH; install one "
            "(Debian: gcc and libc6-dev), or use the simulated camera, which needs none"
        )
    library = folder / "gonio_v4l2_shim.so"
    command = [compiler, *_OPTIONS, "-o", str(library), str(_SOURCE), "-ldl", "-lpthread"]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=_PATIENCE_S
        )
    except subprocess.TimeoutExpired as error:
        raise DeviceError(
            f"emulated camera: {compiler} has not compiled {_SOURCE.name} in {_PATIENCE_S:g} s, "
            "and was ended: look at what it waits for"
        ) from error
    if done.returncode != 0:
        raise DeviceError(
            f"emulated camera: {compiler} could not compile {_SOURCE.name}:\n{done.stderr.strip()}"
        )
    return library


def shim_environment(shim: Path, device: str, socket: Path) -> dict[str, str]:
    """Return the environment variables that make `device` the camera behind `socket`."""
    before = os.environ.get("LD_PRELOAD", "")
    return {
        "LD_PRELOAD": f"{shim} {before}".strip(),
        "GONIO_V4L2_DEVICE": device,
        "GONIO_V4L2_SOCKET": str(socket),
    }
