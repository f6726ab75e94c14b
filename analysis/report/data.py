"""Content of a report: plain values, ready to plot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from instrument.geometry import BoolArray, FloatArray, IntArray
from instrument.record.reading import Preview

Rows = tuple[tuple[str, str], ...]

# BRDF (M,) in 1/sr as a function of theta_i, dphi and signed theta_r (M,), in degrees.
Curve = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]

# Models plotted per sweep, the chosen one included.
MAX_LINES = 3

_COLUMNS = (
    "dphi_deg", "theta_r_deg", "brdf", "u_brdf", "radiance", "u_radiance", "flags", "fitted",
)  # fmt: skip


class Quantity(NamedTuple):
    """Measured quantity: its name, its unit, and its name as a column of a table."""

    name: str
    unit: str
    column: str

    @property
    def title(self) -> str:
        """The name as the first word of a heading or a line."""
        return self.name[:1].upper() + self.name[1:]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A fitted parameter; `u` is None where the data do not determine it.

    `interval` is then its 95 % interval, in the same unit; None for a model that is not chosen.
    """

    name: str
    value: float
    u: float | None
    interval: tuple[float, float] | None
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A fitted model and its agreement with the data.

    residuals: (measured - model - errors that points share) / u of the points in the fit, in their
        order.
    curve: BRDF of the fitted model. agrees: the model agrees with the data.
    """

    name: str
    parameters: tuple[Parameter, ...]
    rms_relative: float
    reduced_chi2: float | None
    bic: float | None
    converged: bool
    chosen: bool
    agrees: bool = True
    message: str = ""
    residuals: FloatArray | None = None
    curve: Curve | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LampLevels:
    """Level of the lamp at the drift checks (C,) made with one setting by hand, with its u.

    Both are relative to the first check. theta_i_deg, theta_r_deg: of the checks, in degrees.
    time_s: since the first reading. stretch: number of the steady stretch between two jumps.
    """

    theta_i_deg: float
    theta_r_deg: float
    time_s: FloatArray
    level: FloatArray
    u: FloatArray
    stretch: IntArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rendered:
    """Sphere of the fitted material and of Lambert's law, and a profile as each would find it.

    name: of the model. albedo: of Lambert's law. model, lambert: radiance (R, C), NaN beside the
    sphere. places (N,): across the profile of a shape; heights (N,): the true ones there, and as
    found by each law. scene: lamp and scale. cost: what Lambert's law would cost, in a sentence.
    """

    name: str
    albedo: float
    model: FloatArray
    lambert: FloatArray
    shape: str
    places: FloatArray
    heights: FloatArray
    lambert_heights: FloatArray
    model_heights: FloatArray
    scene: str
    cost: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportData:
    """Content of a report. Arrays and `flags` have one entry per point (N,).

    theta_i_deg, dphi_deg, theta_r_deg: in degrees, theta_r signed.
    brdf, u_brdf: in 1/sr; NaN throughout where no white tile was measured. With `relative_brdf` in
        a unit of their own, which nothing fixes.
    radiance, u_radiance: in counts/s.
    flags: empty for a good point. fitted: True for the points in the fit.
    verdict: the headline, then further sentences. verdict_kind: `adequate`, `none adequate`, `not
        identifiable`, or empty where nothing was fitted; sets the colour of the box.
    budget: rows of (component, median relative u in %, share of the variance in %).
    sources: relative standard uncertainties (N,) by source, those of one kind combined.
    chosen_for: what a scan that chose its geometries measured each point for; else empty.
    rendered: makes pictures of the chosen model. lamp: levels at the drift checks.
    calibrations, files: what they found, and hashes.
    """

    title: str
    sample: str
    description: str
    verdict: tuple[str, ...]
    verdict_kind: str
    notes: tuple[str, ...]
    theta_i_deg: FloatArray
    dphi_deg: FloatArray
    theta_r_deg: FloatArray
    brdf: FloatArray
    u_brdf: FloatArray
    radiance: FloatArray
    u_radiance: FloatArray
    flags: tuple[str, ...]
    fitted: BoolArray
    candidates: tuple[Candidate, ...] = ()
    budget: tuple[tuple[str, float, float], ...] = ()
    sources: Mapping[str, FloatArray] = field(default_factory=dict)
    relative_brdf: bool = False
    chosen_for: tuple[str, ...] = ()
    lamp: tuple[LampLevels, ...] = ()
    previews: tuple[Preview, ...] = ()
    rendered: Callable[[], Rendered | None] | None = None
    rig: Rows = ()
    devices: Rows = ()
    calibrations: Rows = ()
    files: Rows = ()
    metadata: Rows = ()
    versions: Rows = ()
    times: Rows = ()

    def __post_init__(self) -> None:
        points, fitted = len(self.theta_i_deg), int(np.count_nonzero(self.fitted))
        for name in (*_COLUMNS, *(("chosen_for",) if self.chosen_for else ())):
            if (size := len(getattr(self, name))) != points:
                raise ValueError(f"{name}: {size} entries for {points} points")
        for c in self.candidates:
            if c.residuals is not None and len(c.residuals) != fitted:
                size = len(c.residuals)
                raise ValueError(f"{c.name}: {size} residuals for {fitted} points in the fit")

    @property
    def has_brdf(self) -> bool:
        """True if at least one point has a BRDF, relative to a white tile."""
        return bool(np.any(np.isfinite(self.brdf)))

    @property
    def measured(self) -> Quantity:
        """The measured quantity: BRDF, relative BRDF, or radiance without a white tile."""
        if not self.has_brdf:
            return Quantity("radiance", "counts/s", "radiance_counts_per_s")
        if self.relative_brdf:
            return Quantity("relative BRDF", "", "brdf_relative")
        return Quantity("BRDF", "1/sr", "brdf_per_sr")

    @property
    def quantity(self) -> str:
        """Name and unit of the measured quantity, as on an axis."""
        name, unit, _ = self.measured
        return f"{name} ({unit})" if unit else name

    @property
    def absolute(self) -> bool:
        """True where the values have a scale; else lines of models are scaled to the points."""
        return self.has_brdf and not self.relative_brdf

    @property
    def value_and_u(self) -> tuple[FloatArray, FloatArray]:
        """BRDF (N,) and its u in 1/sr; without a white tile radiance and its u in counts/s."""
        if self.has_brdf:
            return self.brdf, self.u_brdf
        return self.radiance, self.u_radiance

    @property
    def flagged(self) -> BoolArray:
        """Boolean mask (N,) of the points with a flag."""
        return np.array([bool(flag) for flag in self.flags], dtype=bool)

    @property
    def ranked(self) -> tuple[Candidate, ...]:
        """The candidates by rising BIC, the chosen one first; those that failed come last."""

        def rank(c: Candidate) -> tuple[bool, bool, float]:
            bic = c.bic if c.bic is not None and np.isfinite(c.bic) else np.inf
            return not c.chosen, not c.converged, bic

        return tuple(sorted(self.candidates, key=rank))

    @property
    def plotted(self) -> tuple[Candidate, ...]:
        """The candidates that are plotted as lines: the chosen one and those next to it by BIC."""
        with_curve = [c for c in self.ranked if c.curve is not None and (c.chosen or c.converged)]
        return tuple(with_curve[:MAX_LINES])
