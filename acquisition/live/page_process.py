"""Process of the live page, as the program that scans starts it and ends it.

The scan waits for nothing: the address is known before the page is ready, since the socket and the
token are made here. The page's standard input says that the scan is alive: it ends with it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import IO

from acquisition.live.address import address, listening_socket, new_token
from acquisition.terminal.console import console
from instrument.errors import InputError

_NICENESS = 10
_MOST_PIXELS = 2**27  # of a picture: twice those of the largest camera that a record can hold
_LIBRARIES = ("starlette", "uvicorn")
_END_S = 8.0  # for the last messages and the last fit
_ROOT = Path(__file__).parents[2]  # from which the page process imports the same program


def be_modest() -> None:
    """Leave the machine to a scan that goes on, and refuse pictures of any size; before NumPy."""
    os.nice(_NICENESS)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(_MOST_PIXELS))


def require_libraries() -> None:
    """Raise `InputError` if the libraries of the live page are not installed."""
    missing = [name for name in _LIBRARIES if find_spec(name) is None]
    if missing:
        raise InputError(
            f"the live page needs {' and '.join(missing)}, which this Python does not have: "
            "pip install 'gonio[live]'"
        )


@contextmanager
def live_page(watched: Path, *, aiming: bool = False, port: int = 0) -> Iterator[str]:
    """Serve the live page by a process of its own, in a `with` block; yield its address.

    watched: the run's folder, which must have its input files; with `aiming` the channel of a
    camera that is being aimed. Raises `InputError` if the libraries or the port cannot be had.
    """
    require_libraries()
    token = new_token()
    with tempfile.TemporaryFile() as messages:
        with listening_socket(port) as listener:
            found = address(listener, token)
            what = ["--aim" if aiming else "--run", str(watched.absolute())]
            page = _started(what, token, listener.fileno(), messages)
        try:
            yield found
        finally:
            _end(page, messages)


def _started(
    what: list[str], token: str, socket: int, messages: IO[bytes]
) -> subprocess.Popen[bytes]:
    """Start the process: in the background of the terminal, whose Ctrl-C is for the scan."""
    page = subprocess.Popen(
        [sys.executable, "-m", "acquisition.live", *what, "--socket", str(socket)],
        cwd=_ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=messages,
        pass_fds=(socket,),
        process_group=0,
    )
    with suppress(OSError):  # it has ended already, and says why
        _input_of(page).write(f"{token}\n".encode())
        _input_of(page).flush()
    return page


def _end(page: subprocess.Popen[bytes], messages: IO[bytes]) -> None:
    """Let the process send what is left and end, in the time that it should take."""
    with suppress(OSError):
        _input_of(page).close()
    try:
        if page.wait(_END_S) != 0:
            _say_why(page.returncode, messages)
    except subprocess.TimeoutExpired:
        pass
    finally:
        page.kill()
        page.wait()


def _say_why(code: int, messages: IO[bytes]) -> None:
    """Print the last words of a page that has failed: nothing else tells the operator."""
    messages.seek(0)
    lines = messages.read().decode("utf-8", "replace").strip().splitlines() or [f"exit code {code}"]
    console.print(f"the live page had ended early: {lines[-1]}", highlight=False, soft_wrap=True)


def _input_of(page: subprocess.Popen[bytes]) -> IO[bytes]:
    if page.stdin is None:
        raise ValueError("the process was started without a pipe")
    return page.stdin
