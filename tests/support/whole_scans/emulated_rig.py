"""The emulated rig as shipped, and one that takes less time."""

from __future__ import annotations

from tests.support.paths import CONFIGS

EMULATED_RIG = CONFIGS / "rigs" / "emulated.yaml"


def quick_emulated_rig() -> str:
    """Return the text of the emulated rig with short homing and pixels twice as wide.

    Rendering takes most of the time, and of an axis that moves each frame is rendered several
    times.
    """
    text = EMULATED_RIG.read_text()
    changes = {"homing_s: 2.0": "homing_s: 0.2", "width_px: 320": "width_px: 160",
               "height_px: 256": "height_px: 128", "row_px: 128.5": "row_px: 64.0",
               "column_px: 158.0": "column_px: 78.75"}  # fmt: skip
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    return text
