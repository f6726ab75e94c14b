"""Live pages in the test's own process, of a run's folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from acquisition.live.address import address, listening_socket
from acquisition.live.live_page import LivePage

TOKEN = "a-token_of-the_tests"


@contextmanager
def served(run: Path) -> Iterator[str]:
    """The page of a run; its address."""
    listener = listening_socket(0)
    found = address(listener, TOKEN)
    with LivePage(run, listener, TOKEN):
        yield found
