"""Python interface of the gonioreflectometer, for notebooks and scripts.

Runs: `load` a measured one, `plan` and `run` a protocol. Tables: `read_table`, `read_curet`, or
`Measurements.bare` for arrays. `fit` finds the simplest model that explains any of them. `MODELS`
are the reflectance models by name, `Geometry` the directions that they take. `open_rig` and
`gonio_scan` are for bluesky's run engine.

Every array names its unit. Errors are `GonioError`: `InputError` for a mistake in a file or an
argument, `DeviceError`, `StorageError`, and `NotDetermined` where the data allow no fit.
"""

from __future__ import annotations

from acquisition.facility.devices.rig_devices import open_rig
from acquisition.facility.plans import gonio_scan
from acquisition.facility.tiled_server import fetch_table
from acquisition.notebook.fits import Fit, fit
from acquisition.notebook.runs import Run, load
from acquisition.notebook.scans import PlannedScan, plan, run
from acquisition.notebook.tables import Table, read_curet, read_table
from analysis.data.measurements import Measurements
from analysis.models import MODELS
from instrument.errors import (
    DeviceError,
    GonioError,
    InputError,
    NotDetermined,
    OperatorStop,
    StorageError,
)
from instrument.geometry import Geometry

__all__ = [
    "MODELS",
    "DeviceError",
    "Fit",
    "Geometry",
    "GonioError",
    "InputError",
    "Measurements",
    "NotDetermined",
    "OperatorStop",
    "PlannedScan",
    "Run",
    "StorageError",
    "Table",
    "fetch_table",
    "fit",
    "gonio_scan",
    "load",
    "open_rig",
    "plan",
    "read_curet",
    "read_table",
    "run",
]
