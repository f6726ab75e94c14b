"""Scans from a notebook: what a protocol would do, and doing it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.commands.determinable import Determinable
from acquisition.commands.scan import scan_into
from acquisition.notebook.runs import Run, load
from acquisition.plan.plan import Plan, make_plan
from acquisition.results.finish import finish
from acquisition.results.model_check import check_model
from instrument.config.load import Loaded, load_protocol
from instrument.errors import InputError
from instrument.geometry import FloatArray


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PlannedScan:
    """Scan that a protocol plans, of N points; `scan` holds its steps, `loaded` both files."""

    scan: Plan
    loaded: Loaded

    @property
    def theta_i_deg(self) -> FloatArray:
        """Angle of incidence of each point, (N,) in degrees."""
        return np.array([step.pose.theta_i for step in self.scan.points])

    @property
    def theta_r_deg(self) -> FloatArray:
        """View angle of each point, (N,) in degrees; signed."""
        return np.array([step.pose.theta_r for step in self.scan.points])

    @property
    def dphi_deg(self) -> FloatArray:
        """Azimuth between lamp and camera of each point, (N,) in degrees."""
        return np.array([step.pose.dphi for step in self.scan.points])

    @property
    def hidden(self) -> int:
        """Number of geometries left out, as camera and lamp hide one another."""
        return len(self.scan.hidden)

    @property
    def duration_s(self) -> float:
        """Planned duration in seconds."""
        return self.scan.duration_s

    @property
    def can_determine(self) -> tuple[str, ...]:
        """Names of the parameters and ratios that the scan can determine."""
        return self._determinable.yes

    @property
    def will_not_determine(self) -> tuple[str, ...]:
        """Names of the parameters that the scan will not determine."""
        return self._determinable.no

    @property
    def _determinable(self) -> Determinable:
        return Determinable.of(self.loaded.protocol, [step.pose for step in self.scan.points])

    def __repr__(self) -> str:
        name, points = self.loaded.protocol.name, len(self.scan.points)
        return f"<plan of {name!r}: {points} points, {self.hidden} hidden, {self.duration_s:.0f} s>"


def plan(protocol: Path | str, rig: Path | str | None = None) -> PlannedScan:
    """Plan the scan of a protocol file; opens no device.

    rig: a rig file in place of the one that the protocol names. Raises `InputError` that names
    every mistake with file, line and column.
    """
    loaded = _load(protocol, rig)
    return PlannedScan(make_plan(loaded), loaded)


def run(protocol: Path | str, rig: Path | str | None = None, out: Path | str | None = None) -> Run:
    """Scan by a protocol file, fit and report, as `gonio run` does; return the run.

    rig: a rig file in place of the one that the protocol names. out: folder for the run, absent or
    empty; default `runs/NAME-DATE-TIME`. Raises `InputError` before anything moves; `DeviceError`,
    `StorageError` or `OperatorStop` where the scan ends early, with the command that resumes it.
    A rig whose camera is emulated needs a process of its own: `gonio run`.
    """
    loaded = _load(protocol, rig)
    if loaded.rig.emulated:
        raise InputError(
            f"{loaded.rig_path}: its camera is emulated, which needs a process of its own: use the "
            "command gonio run, then gonio.load"
        )
    return load(scan_into(loaded, None if out is None else Path(out), finish))


def _load(protocol: Path | str, rig: Path | str | None) -> Loaded:
    rig_path = None if rig is None else Path(rig)
    return load_protocol(Path(protocol), rig_path, check_model=check_model)
