"""Debian's Chromium, driven by Playwright, and pages in it that must not complain."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Browser, ConsoleMessage, Page, ViewportSize

CHROMIUM = Path("/usr/bin/chromium")
DEADLINE_S = 60.0
"""Until the page must show something; most of it is for a machine that is busy."""
_QUIET = ("--disable-gpu", "--disable-quic", "--disable-background-networking",
          "--disable-component-update", "--disable-sync", "--no-first-run")  # fmt: skip
# A picture that the next one has replaced before it was fetched: the page takes the next one.
_SUPERSEDED = re.compile(r"/pictures/\d+\.jpg")


def missing() -> str:
    """Return why there is no browser to test with, empty if there is one."""
    if not CHROMIUM.exists():
        return "the live page is tested in Chromium: apt-get install chromium"
    if importlib.util.find_spec("playwright") is None:
        return "the live page is tested with Playwright: pip install playwright"
    return ""


@contextmanager
def chromium() -> Iterator[Browser]:
    """Run the browser, in a `with` block."""
    from playwright.sync_api import expect, sync_playwright

    expect.set_options(timeout=1000 * DEADLINE_S)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(_QUIET))
        try:
            yield browser
        finally:
            browser.close()


class Windows:
    """Windows of a browser, each with cookies of its own; `complaints` of all of them."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self.complaints: list[str] = []
        self.requested: set[str] = set()

    def open(self, address: str, width: int = 1400) -> Page:
        """Open an address in a new window."""
        viewport: ViewportSize = {"width": width, "height": 1000}
        context = self._browser.new_context(viewport=viewport, color_scheme="dark")
        page = context.new_page()
        page.set_default_timeout(1000 * DEADLINE_S)
        page.on("console", self._note)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", lambda request: self.requested.add(request.url))
        page.goto(address)
        return page

    def _note(self, message: ConsoleMessage) -> None:
        superseded = _SUPERSEDED.search(message.location.get("url", ""))
        if message.type in ("error", "warning") and not superseded:
            self.complaints.append(f"{message.text} ({message.location})")

    def close(self) -> None:
        """Close all windows."""
        for context in self._browser.contexts:
            context.close()
