"""Runs as a notebook has them: arrays with uncertainties and flags, a fit, a chart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from acquisition.notebook.figures import Points, brdf_figure
from acquisition.notebook.fits import Fit, fit_of
from acquisition.notebook.frames import data_frame
from acquisition.results.damage import damage_text
from acquisition.results.fitting import Fitted, fit_run, measurements
from acquisition.results.reduction import Reduced, reduced_run, require_usable
from acquisition.results.run_folder import load_run_inputs
from acquisition.results.summary import scan_state
from analysis.data.acceptance import Acceptance
from analysis.data.measurements import Measurements, SharedError
from instrument.config.load import Loaded
from instrument.geometry import BoolArray, FloatArray
from instrument.record.record import Record

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLUMNS = (
    *("theta_i_deg", "theta_r_deg", "dphi_deg", "brdf_per_sr", "u_brdf_per_sr"),
    *("radiance_dn_per_s", "u_radiance_dn_per_s", "flags"),
)


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """Measured scan of N points, complete or not, in the order of the scan.

    folder: of the run. state: the scan is complete, or what is missing of it. damage: readings that
    changed on the disk and were left out, empty if none. reduced, loaded: everything else, as the
    program has it.
    """

    folder: Path
    state: str
    damage: str
    reduced: Reduced
    loaded: Loaded

    @property
    def name(self) -> str:
        """Name of the protocol."""
        return self.loaded.protocol.name

    @property
    def theta_i_deg(self) -> FloatArray:
        """Angle of incidence, (N,) in degrees."""
        return np.array([p.theta_i_deg for p in self.reduced.points])

    @property
    def theta_r_deg(self) -> FloatArray:
        """View angle, (N,) in degrees; positive on the side that `dphi_deg` names."""
        return np.array([p.theta_r_deg for p in self.reduced.points])

    @property
    def dphi_deg(self) -> FloatArray:
        """Azimuth between lamp and camera, (N,) in degrees: 0 the lamp's side, 180 the mirror's."""
        return np.array([p.dphi_deg for p in self.reduced.points])

    @property
    def brdf_per_sr(self) -> FloatArray:
        """BRDF, (N,) in 1/sr; NaN where there is no white tile to compare with."""
        return self.reduced.brdf

    @cached_property
    def u_brdf_per_sr(self) -> FloatArray:
        """Standard uncertainty of the BRDF (k = 1), (N,) in 1/sr, as in measurements.csv.

        For fitted points it includes the part due to the angles, which takes the run's own fit.
        """
        return self._own_fit.u_brdf(self.reduced)

    @property
    def radiance_dn_per_s(self) -> FloatArray:
        """Radiance, (N,) in counts (DN) per second, corrected for the lamp's drift."""
        return self.reduced.radiance

    @property
    def u_radiance_dn_per_s(self) -> FloatArray:
        """Standard uncertainty of the radiance (k = 1), (N,) in counts (DN) per second."""
        return self.reduced.u_radiance

    @cached_property
    def u_parts_relative(self) -> Mapping[str, FloatArray]:
        """Standard uncertainties of the BRDF by cause, (N,) each, relative, as in measurements.csv.

        That of the angles takes the run's own fit: NaN for points that were not fitted.
        """
        return self._own_fit.parts(self.reduced)

    @property
    def shared(self) -> tuple[SharedError, ...]:
        """Errors that points share: relative u (N,), and a number (N,) equal where they share it.

        They are parts of `u_parts_relative`; a mean over points does not reduce them.
        """
        return (*self.reduced.shared, *self.reduced.shared_by_tile)

    @property
    def flags(self) -> tuple[str, ...]:
        """Flags of each point, N texts in words; empty for a good one."""
        return self.reduced.flags

    @property
    def valid(self) -> BoolArray:
        """True for the points that are fitted, (N,)."""
        return self.reduced.valid

    @property
    def measurements(self) -> Measurements:
        """The valid points as the fit takes them; raises as `fit` does where there is none."""
        require_usable(self.reduced)
        return measurements(self.reduced, self.loaded)

    def fit(
        self,
        models: Sequence[str] | None = None,
        *,
        method: str = "auto",
        robust: bool = False,
    ) -> Fit:
        """Find the simplest model that explains the run: see `gonio.fit`.

        Without `models` and with the method "auto", those of the protocol.
        """
        asked = self.loaded.protocol.fit
        own = models is None and method == "auto"
        return fit_of(
            self.measurements,
            Acceptance.of(self.loaded.rig, self.loaded.protocol.window),
            self._points,
            used=self.valid,
            models=asked.models if own else models,
            method=asked.method if own else method,
            robust=robust,
            certificate_leads=asked.certificate_leads,
        )

    def plot(self) -> Figure:
        """Draw the BRDF of every sweep with u, and the models of the run's own fit, if it has one.

        Flagged points are crossed out. Raises `NoMeasurement` if there is no point.
        """
        return brdf_figure(self._points, self._own_fit)

    def to_pandas(self) -> Any:
        """Return a pandas DataFrame of N rows; `ImportError` if pandas is not installed."""
        return data_frame({name: getattr(self, name) for name in _COLUMNS})

    @cached_property
    def _own_fit(self) -> Fitted:
        return fit_run(self.reduced, self.loaded)

    @property
    def _points(self) -> Points:
        return Points(
            theta_i_deg=self.theta_i_deg,
            theta_r_deg=self.theta_r_deg,
            dphi_deg=self.dphi_deg,
            brdf=self.brdf_per_sr,
            u_brdf=self.u_brdf_per_sr,
            radiance=self.radiance_dn_per_s,
            u_radiance=self.u_radiance_dn_per_s,
            flags=self.flags,
        )

    def __repr__(self) -> str:
        flagged = sum(map(bool, self.flags))
        noted = (f", {flagged} flagged" if flagged else "") + (", damaged" if self.damage else "")
        return f"<run {self.name!r}: {len(self.flags)} points{noted}; {self.state}>"


def load(folder: Path | str) -> Run:
    """Load a run from its folder, also one that is being scanned or was stopped.

    Raises `InputError` if the folder is no run or its protocol or rig file was changed since, and
    `StorageError` if its record cannot be read.
    """
    with Record.open(Path(folder)) as record:
        loaded = load_run_inputs(record)
        reduced = reduced_run(record, loaded)
        return Run(Path(folder), scan_state(record), damage_text(record), reduced, loaded)
