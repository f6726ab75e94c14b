"""Figure 16 of the 1998 paper: from which roughness on geometry rules reflection."""

from __future__ import annotations

from functools import partial

import numpy as np

from analysis.gallery.figure import Check, PaperFigure
from analysis.gallery.panels import Axis, Line, chart
from analysis.models import MODELS
from analysis.models.smooth.wolff_oren_nayar import roughness_share
from instrument.geometry import Geometry

_AT_MOST = ((10, 9.0), (20, 6.0), (100, 2.5))  # C1 over the bound, and sigma in degrees below it
_AT_LEAST = ((2, 36.0), (3, 22.0), (4, 17.0))


def figure_16() -> PaperFigure:
    """C1 and the bound of C2 and C3 against the roughness."""
    sigma = np.linspace(0.0, 60.0, 241)
    # At normal incidence only C1 is left, and at n = 1 there is no interface.
    normal = Geometry.from_degrees(theta_i=0.0, theta_r=0.0)
    brdf = partial(MODELS["wolff_oren_nayar"].brdf, normal, albedo=1.0, n=1.0)
    C1 = np.pi * np.array([float(brdf(sigma_deg=float(s))) for s in sigma])
    bound = C1 * np.array([roughness_share(float(s)) for s in sigma])
    lines = (Line(sigma, C1, "C₁", 0), Line(sigma, bound, "upper bound of C₂ and C₃", 1))
    return PaperFigure(
        number="16",
        title="C<sub>1</sub>, and the upper bound of C<sub>2</sub> and C<sub>3</sub>",
        caption=(
            "Coefficients of (3), with C<sub>1</sub> of (9) at normal incidence and without its "
            "Fresnel factors, against the roughness; the bound is 0.45 σ²/(σ² + 0.09)."
        ),
        panels=(
            chart(
                "", lines, Axis("roughness σ (°)", (0.0, 60.0)), Axis("coefficient", (0.0, 1.05))
            ),
        ),
        checks=(
            *(_reached(factor, stated, "below") for factor, stated in _AT_MOST),
            *(_reached(factor, stated, "above") for factor, stated in _AT_LEAST),
        ),
    )


def _reached(factor: int, stated: float, side: str) -> Check:
    sigma = np.linspace(0.5, 50.0, 9901)
    share = np.array([roughness_share(float(s)) for s in sigma])
    found = float(np.interp(1 / factor, share, sigma))
    said = (
        f"C<sub>1</sub> is at least {factor} times the bound below σ = {stated:g}°"
        if side == "below"
        else f"the bound is at least 1/{factor} of C<sub>1</sub> above σ = {stated:g}°"
    )
    return Check(said, f"reached at {found:.2f}°", abs(found - stated) < 0.5)
