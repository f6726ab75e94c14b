"""A small simulated rig whose devices a run engine drives."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from acquisition.facility.devices.rig_devices import RigDevices, open_rig
from tests.support.scans import small_rig


@pytest.fixture
def rig_file(tmp_path: Path) -> Path:
    return small_rig(tmp_path, shrink=10)


@pytest.fixture
def rig(rig_file: Path) -> Iterator[RigDevices]:
    with open_rig(rig_file) as devices:
        yield devices
