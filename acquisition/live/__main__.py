"""Process of the live page: `python -m acquisition.live --run FOLDER --socket NUMBER`.

The first line of its standard input is the token. It ends soon after its standard input does: the
program that scans has ended, in whichever way.
"""

from __future__ import annotations

import argparse
import os
import signal
import socket
import sys
from pathlib import Path

# Before NumPy: a scan has the machine, and several threads in linear algebra would only cost time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from acquisition.live.live_page import LivePage
from acquisition.live.page_process import NICENESS
from instrument.errors import GonioError


def main() -> None:
    """Serve the page until the standard input ends."""
    be_quiet()
    found = _arguments()
    watched = found.run or found.aim
    listener = socket.socket(fileno=found.socket)
    token = sys.stdin.readline().strip()
    try:
        with LivePage(watched, listener, token, aiming=found.run is None) as page:
            sys.stdin.read()
            page.finish()
    except GonioError as error:
        sys.exit(str(error))


def be_quiet() -> None:
    """Leave the processor to the scan, and the keys of the terminal as well."""
    os.nice(NICENESS)
    for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())  # a scan blocks signals while it ends


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m acquisition.live", description=__doc__)
    watched = parser.add_mutually_exclusive_group(required=True)
    watched.add_argument("--run", type=Path, help="folder of the run")
    watched.add_argument("--aim", type=Path, help="channel of a camera that is being aimed")
    parser.add_argument("--socket", type=int, required=True, help="number of the listening socket")
    return parser.parse_args()


if __name__ == "__main__":
    main()
