"""Dark patch beside the sample, and lenses that scatter light."""

from __future__ import annotations

from instrument.config.camera import DarkPatch
from instrument.config.load import Loaded
from instrument.config.rig import Simulation
from tests.support.scans import changed

TRAP = DarkPatch(
    x_mm=0.0, y_mm=27.4, width_mm=40.0, height_mm=2.4, reflectance=0.01, u_reflectance=0.0
)


def with_patch(loaded: Loaded, patch: DarkPatch | None, **lens: float) -> Loaded:
    """Copy of the configuration with this dark patch, and with the lens's defects alone."""
    own = {**loaded.rig.simulation.model_dump(), "lens_defects": lens}
    camera = loaded.rig.camera.model_copy(update={"dark_patch": patch})
    return changed(loaded, rig={"camera": camera, "simulation": Simulation.model_validate(own)})
