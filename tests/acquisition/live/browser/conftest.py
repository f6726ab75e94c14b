"""One browser for all tests of the live page; after each test, what it complained about."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import pytest

from tests.support.live.chromium import Windows, chromium
from tests.support.live.message_page import MessagePage, message_page

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """Chromium; the files of tests are skipped where there is none."""
    with chromium() as found:
        yield found


@pytest.fixture
def windows(browser: Browser) -> Iterator[Windows]:
    """Windows that may complain of nothing, and ask only the page's own server."""
    opened = Windows(browser)
    yield opened
    opened.close()
    assert not opened.complaints
    assert {urlsplit(address).hostname for address in opened.requested} <= {"127.0.0.1"}


@pytest.fixture
def served(tmp_path: Path) -> Iterator[MessagePage]:
    """Page without messages."""
    with message_page(tmp_path) as page:
        yield page
