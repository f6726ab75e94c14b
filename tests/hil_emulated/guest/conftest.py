"""Fixtures of the guest's own tests: the bench on the host, and its camera made whole again."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from tests.hil_emulated.guest.devices import CAMERA, wait_for_node
from tests.hil_emulated.link import ADDRESS, Bench


@pytest.fixture(scope="session")
def bench() -> Bench:
    if ADDRESS not in os.environ:
        pytest.skip("needs the emulated computer: make hil-emulated")
    return Bench.connected()


@pytest.fixture
def camera(bench: Bench) -> Iterator[Bench]:
    """The camera in order: its frames tell how they were taken."""
    wait_for_node(CAMERA)
    bench.show("levels")
    yield bench
    bench.reset_camera()
    bench.show("surface")
