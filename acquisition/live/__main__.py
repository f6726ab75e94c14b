"""Process of the live page: `python -m acquisition.live --run FOLDER --socket NUMBER`.

The first line of its standard input is the token. It ends soon after its standard input does: the
program that scans has ended, in whichever way.
"""

from __future__ import annotations

import argparse
import signal
import socket
import sys
from pathlib import Path

from acquisition.live.page_process import be_modest
from instrument.errors import GonioError


def main() -> None:
    """Serve the page until the standard input ends."""
    _leave_the_keys()
    be_modest()
    from acquisition.live.live_page import LivePage

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


def _leave_the_keys() -> None:
    """Ignore the keys of the terminal, which are for the scan, and unblock what it had blocked."""
    for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m acquisition.live", description=__doc__)
    watched = parser.add_mutually_exclusive_group(required=True)
    watched.add_argument("--run", type=Path, help="folder of the run")
    watched.add_argument("--aim", type=Path, help="channel of a camera that is being aimed")
    parser.add_argument("--socket", type=int, required=True, help="number of the listening socket")
    return parser.parse_args()


if __name__ == "__main__":
    main()
