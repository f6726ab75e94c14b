"""Calibration of a geometry that was not measured, for tests of its file and of its use."""

from __future__ import annotations

import numpy as np

from instrument.calibration.geometry_file import CORNER_COLUMNS, ZERO, GeometryCalibration
from instrument.calibration.quantity import Quantity

FOUND = GeometryCalibration(
    camera="camera 1", stage="stage 2", size_px=(640, 512), rig="bench", board="6 x 6",
    date_utc="2026-11-28T01:00:00+00:00", program="gonio 0", field_width_mm=72.1,
    axis_row_px=250.0, axis_column_px=317.25, roll_deg=0.4, zero_deg=-0.05, sign=1,
    quantities={ZERO: Quantity(value=0.05, u=0.01, unit="deg", symbol="", name="zero")},
    notes=("a note",), arrays={"corners": np.arange(16.0).reshape(2, len(CORNER_COLUMNS))},
)  # fmt: skip
