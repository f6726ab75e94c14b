"""Short adaptive scan whose pictures are rendered fast."""

from __future__ import annotations

from acquisition.adaptive.candidate_list import candidate_list, with_goal
from instrument.config.load import Loaded
from instrument.config.protocol import FitConfig
from tests.support.scans import changed, shortest_scan

_VIEWS = [-70.0, -45.0, -20.0, 20.0, 45.0, 70.0]


def short_list() -> Loaded:
    """A matt sample at two incidences: 22 candidates, drift checks after each two."""
    loaded = shortest_scan()
    (sweep,) = loaded.protocol.sweeps
    fit = FitConfig(models=["lambert", "minnaert"])
    wide = changed(loaded, sweeps=[{**sweep, "theta_r_deg": _VIEWS}], fit=fit)
    return candidate_list(with_goal(wide, "albedo=0.02", None))
