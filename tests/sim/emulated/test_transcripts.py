"""Emulated controllers say of which real device they are a transcript, and what is not verified.

Driver and emulated controller have one author: a shared mistake passes every other test.
"""

from __future__ import annotations

import importlib
import re

import pytest

from tests.support.paths import ROOT

CONTROLLERS = sorted(path.stem for path in (ROOT / "sim" / "emulated").glob("*_controller.py"))
MODULES = (*CONTROLLERS, "v4l2.device")


@pytest.mark.parametrize("module", MODULES)
def test_each_emulated_controller_names_its_sources(module: str) -> None:
    assert CONTROLLERS
    said = importlib.import_module(f"sim.emulated.{module}").__doc__ or ""
    assert re.search(r"Transcripts: .*Not verified on a (device|drive):", said, re.DOTALL)
