"""Fixtures of the V4L2 tests; `remote`, the child process, is in the main conftest."""

from __future__ import annotations

import pytest

from tests.support.v4l2.remote_camera import LevelScene


@pytest.fixture
def scene() -> LevelScene:
    return LevelScene()
