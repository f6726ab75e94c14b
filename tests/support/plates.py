"""Plates with markers beside the sample, somewhere on the table of the simulated rig."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from instrument.config.load import Loaded
from instrument.config.protocol import Markers
from sim.scene.render import electrons_per_s
from tests.support.scans import changed, exact_rig, simulated_scene

MARKERS = Markers(
    size_mm=6.0, centres_mm=[[-30.0, 12.0], [30.0, 12.0], [30.0, -12.0], [-30.0, -12.0]]
)
"""Beside a sample of 50.8 mm, in a picture 72 mm wide."""


def with_plate(
    loaded: Loaded, x_mm: float, y_mm: float, turn_deg: float, height_mm: float = 0.0
) -> Loaded:
    """The scan with markers, its sample's plate shifted, turned and raised; exact otherwise."""
    rig = exact_rig(loaded.rig)
    place = rig.simulation.sample_placement.model_copy(
        update={"shift_x_mm": x_mm, "shift_y_mm": y_mm, "turn_deg": turn_deg}
    )
    simulation = rig.simulation.model_copy(
        update={"sample_placement": place, "sample_height_mm": height_mm}
    )
    whole = rig.model_copy(update={"simulation": simulation})
    return changed(loaded, rig=dict(whole), markers=MARKERS)


def picture(
    loaded: Loaded, theta_r_deg: float, random: np.random.Generator, paper: float = 0.9
) -> NDArray[Any]:
    """A picture in 12 bits whose brightest pixel is `paper` of full scale, with noise."""
    light = electrons_per_s(simulated_scene(loaded, theta_r=theta_r_deg))
    counts = light * (paper * 4095 / light.max()) + random.normal(64.0, 4.0, light.shape)
    return np.clip(np.rint(counts), 0, 4095).astype(np.uint16)
