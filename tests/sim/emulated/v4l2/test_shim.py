"""Shim between OpenCV and the emulated camera: a C compiler is needed."""

from __future__ import annotations

from pathlib import Path

import pytest

from instrument.errors import DeviceError
from sim.emulated.v4l2.shim import compile_shim


def test_without_a_compiler_the_emulated_camera_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(DeviceError, match=r"no C compiler: `cc` is not on the PATH; install one"):
        compile_shim(tmp_path)
