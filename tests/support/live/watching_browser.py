"""Chromium that shows the live page while a scan is timed, in a process of its own.

As a program it starts the browser, says so, opens the address that it is told, says so again, and
ends with its standard input.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from tests.support.live.chromium import Windows, chromium
from tests.support.paths import ROOT

_READY, _SHOWN = "ready", "shown"
_END_S = 30.0


class WatchingBrowser:
    """The browser's process: shows one page, from `show` on."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def show(self, address: str) -> None:
        """Begin to open the page; `require_shown` tells whether that has come about."""
        assert self._process.stdin is not None
        print(address, file=self._process.stdin, flush=True)

    def require_shown(self) -> None:
        """Fail unless the page shows points."""
        self._require(_SHOWN)

    def _require(self, word: str) -> None:
        assert self._process.stdout is not None
        said = self._process.stdout.readline().strip()
        assert said == word, f"the browser's process said {said!r} instead of {word!r}"


@contextmanager
def watching_browser() -> Iterator[WatchingBrowser]:
    """Run the browser, in a `with` block.

    It ends with its standard input; if it has to be killed, Chromium ends with the pipe to it.
    """
    with subprocess.Popen(
        [sys.executable, "-m", "tests.support.live.watching_browser"], cwd=ROOT, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
    ) as process:  # fmt: skip
        browser = WatchingBrowser(process)
        try:
            browser._require(_READY)
            yield browser
        finally:
            assert process.stdin is not None
            process.stdin.close()
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                process.kill()


def _main() -> None:
    from playwright.sync_api import expect

    with chromium() as browser:
        windows = Windows(browser)
        _say(_READY)
        page = windows.open(sys.stdin.readline().strip())
        expect(page.locator("#chart-note")).to_contain_text("points measured")
        _say(_SHOWN)
        sys.stdin.read()


def _say(word: str) -> None:
    sys.stdout.write(f"{word}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    _main()
