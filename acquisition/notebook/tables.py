"""Tables of BRDF as a notebook has them: a CSV file, a material of the CUReT database, arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquisition.notebook.figures import brdf_figure
from acquisition.notebook.fits import Fit, fit_of, points_of
from acquisition.notebook.frames import data_frame
from acquisition.results.sources import Source, Wanted, read_source
from analysis.data.measurements import Measurements, SharedError
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Table:
    """BRDF of N geometries from a file, without the rows that are flagged.

    source: the measurements, the rig's acceptance if it is known, and remarks.
    """

    source: Source

    @property
    def measurements(self) -> Measurements:
        """The values with all parts of their uncertainty, as the fit takes them."""
        return self.source.measurements

    @property
    def theta_i_deg(self) -> FloatArray:
        """Angle of incidence, (N,) in degrees."""
        return self.measurements.theta_i_deg

    @property
    def theta_r_deg(self) -> FloatArray:
        """View angle, (N,) in degrees; signed."""
        return self.measurements.theta_r_deg

    @property
    def dphi_deg(self) -> FloatArray:
        """Azimuth between lamp and camera, (N,) in degrees; 180 is the mirror side."""
        return self.measurements.dphi_deg

    @property
    def brdf_per_sr(self) -> FloatArray:
        """BRDF, (N,) in 1/sr; in a unit of its own where the values are relative."""
        return self.measurements.brdf

    @property
    def u_independent_per_sr(self) -> FloatArray | None:
        """Standard uncertainty independent from point to point, (N,) in 1/sr; None: not stated."""
        return self.measurements.u_random

    @property
    def shared(self) -> tuple[SharedError, ...]:
        """Errors that points share, each with its relative u (N,)."""
        return self.measurements.shared

    @property
    def notes(self) -> tuple[str, ...]:
        """Rows left out, and what is assumed as the file does not state it."""
        return tuple(note.text for note in self.source.notes)

    def fit(
        self, models: Sequence[str] | None = None, *, method: str = "auto", robust: bool = False
    ) -> Fit:
        """Find the simplest model that explains the table: see `gonio.fit`."""
        m = self.measurements
        return fit_of(
            m,
            self.source.acceptance,
            points_of(m),
            models=models,
            method=method,
            robust=robust,
        )

    def plot(self) -> Figure:
        """Draw the values of every sweep; `fit().plot()` adds the models."""
        return brdf_figure(points_of(self.measurements), None)

    def to_pandas(self) -> Any:
        """Return a pandas DataFrame of N rows; `ImportError` if pandas is not installed."""
        names = ("theta_i_deg", "theta_r_deg", "dphi_deg", "brdf_per_sr", "u_independent_per_sr")
        columns = {name: getattr(self, name) for name in names}
        return data_frame({name: c for name, c in columns.items() if c is not None})

    def __repr__(self) -> str:
        unit = "relative values" if self.measurements.relative else "BRDF in 1/sr"
        return f"<table of {self.measurements.size} geometries, {unit}>"


def read_table(
    path: Path | str,
    *,
    max_theta_deg: float = 90.0,
    relative: bool = False,
    u_shared: float | None = None,
    repeats: str | None = None,
    cosine_corrected: bool = False,
    mirror_azimuth: bool = False,
) -> Table:
    """Read a table of BRDF: CSV, ASTM, Zemax, pab-opto, ALTA or MERL, told by its content.

    CSV has the columns theta_i_deg, theta_r_deg, dphi_deg in degrees, brdf in 1/sr and, if known,
    u_brdf in 1/sr. Rows beyond `max_theta_deg` (degrees) are left out. relative: the values have no
    absolute scale. u_shared: relative u of an error that all values share. repeats: "mean" averages
    rows of the same geometry. cosine_corrected: the values are BRDF times cos(theta_r).
    mirror_azimuth: azimuth 0 is the mirror side. Raises `InputError` for a wrong file,
    `NotDetermined` if no row is left.
    """
    wanted = Wanted(
        format="csv" if Path(path).is_dir() else "auto",
        max_theta_deg=max_theta_deg,
        relative=relative,
        u_shared=u_shared,
        repeats=repeats,
        cosine_corrected=cosine_corrected,
        mirror_azimuth=mirror_azimuth,
    )
    return Table(read_source(Path(path), wanted))


def read_curet(path: Path | str, sample: int, *, max_theta_deg: float = 90.0) -> Table:
    """Read material number `sample` of the CUReT database from its folder.

    Directions beyond `max_theta_deg` (degrees) are left out. Raises `InputError` for a wrong
    folder or number.
    """
    wanted = Wanted(format="curet", sample=sample, max_theta_deg=max_theta_deg)
    return Table(read_source(Path(path), wanted))
