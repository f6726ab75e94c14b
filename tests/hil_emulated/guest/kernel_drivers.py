"""Pytest plugin of the guest: plugs the USB devices in, and names each test's kernel driver.

The driver is the one that /sys/class shows for each serial port or camera that the test has opened
or held open. A test marked `hil` that went through none is an error: it has tested no kernel.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.hil_emulated.guest.devices import BUS_IDS, plug_in, wait_for_node

_NODE = re.compile(r"/dev/((tty(?:USB|ACM)|video)\d+)$")
_CLASS = {"video": "video4linux"}
_opened: set[str] = set()


def kernel_driver(node: str) -> str | None:
    """Return the driver of a device node, `uvcvideo (video0)`; None for any other file.

    A device that has just been unplugged has none either.
    """
    found = _NODE.match(node)
    if found is None:
        return None
    name, kind = found.groups()
    link = Path("/sys/class") / _CLASS.get(kind, "tty") / name / "device" / "driver"
    return f"{link.resolve().name} ({name})" if link.exists() else None


def pytest_configure() -> None:
    sys.addaudithook(_note_opened)


def pytest_sessionstart() -> None:
    for bus_id, node in BUS_IDS.items():
        plug_in(bus_id)
        wait_for_node(node)


def _note_opened(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and isinstance(arguments[0], str) and arguments[0].startswith("/dev/"):
        _note(arguments[0])


def _note(path: str) -> None:
    driver = kernel_driver(str(Path(path).resolve()))
    if driver is not None:
        _opened.add(driver)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    _opened.clear()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    yield
    for link in Path("/proc/self/fd").iterdir():
        if link.exists():
            _note(str(link.readlink()))
    item.user_properties.append(("drivers", " and ".join(sorted(_opened))))
    assert _opened or not item.get_closest_marker("hil"), "no kernel driver was gone through"


def pytest_report_teststatus(report: pytest.TestReport) -> tuple[str, str, str] | None:
    """Add the drivers to the verbose word of a result."""
    drivers = dict(report.user_properties).get("drivers")
    if report.when != "call" or report.outcome == "skipped" or not drivers:
        return None
    return report.outcome, report.outcome[0].upper(), f"{report.outcome.upper()} through {drivers}"
