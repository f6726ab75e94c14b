"""Quick fit of a rough matt surface with a lobe to the values of a run, for the rig's effects.

Some effects depend on more of the surface than a value shows: on how much of it the facets reflect,
on all the light that the surface reflects to one side. Values without a tile have an unknown unit
at each setting of the lamp, and are fitted as such.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from analysis.data.acceptance import disc_rule
from analysis.data.measurements import Measurements
from analysis.fit.first_fit import FirstFits
from analysis.fit.fit import refine
from analysis.fit.relative_scale import FACTOR_NAME
from analysis.fit.search.problem import Problem
from analysis.models import MODELS
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray, Geometry

_BODY, _LOBES = "oren_nayar", ("torrance_sparrow_lobe", "ggx")
_U_FIT = 0.01  # relative, of the values
_RINGS = 6  # of the hemisphere: 144 directions


@dataclass(frozen=True, slots=True)
class QuickFit:
    """Fitted surface: its problem and parameters x (K,)."""

    problem: Problem
    x: FloatArray

    def values(self, geometry: Geometry) -> FloatArray:
        """Values in the unit of the measured ones, of the geometry's shape."""
        return self.problem.model_brdf(self.x, geometry)

    def share_of_facets(self, geometry: Geometry) -> FloatArray:
        """Share of the values that the facets reflect, 0 to 1, of the geometry's shape."""
        names = (p.name for p in self.problem.model.parameters)
        fitted = dict(zip(names, self.x.tolist(), strict=True))
        lobe = MODELS[self.problem.model.name.removeprefix(f"{_BODY}+")]
        facets = lobe.brdf(geometry, **{p.name: fitted[p.name] for p in lobe.parameters})
        facets *= fitted.get(FACTOR_NAME, 1.0)
        return np.clip(facets / np.maximum(self.values(geometry), 1e-12), 0.0, 1.0)

    def hemisphere_mean(self, theta_r_deg: FloatArray) -> FloatArray:
        """Value, (N,), in light equally bright from all directions, at views (N,) in degrees.

        That is the hemispherical-directional reflectance over pi, in 1/sr or in the values' unit.
        """
        nodes, weights = disc_rule(_RINGS)  # of the unit circle: area is projected solid angle
        theta_i = np.degrees(np.arcsin(np.hypot(nodes[:, 0], nodes[:, 1])))
        dphi = np.degrees(np.arctan2(nodes[:, 1], nodes[:, 0])) % 360.0
        views, of_view = np.unique(np.abs(theta_r_deg), return_inverse=True)
        shape = (views.size, weights.size)
        geometry = Geometry.from_degrees(
            theta_i=np.broadcast_to(theta_i, shape),
            theta_r=np.broadcast_to(views[:, np.newaxis], shape),
            dphi=np.broadcast_to(dphi, shape),
        )
        return np.asarray((self.values(geometry) @ weights)[of_view])


def quick_fit(
    angles_deg: tuple[FloatArray, FloatArray, FloatArray], value: FloatArray, *, absolute: bool
) -> QuickFit | None:
    """Return the better fit with one of two lobes; None if there are too few points to tell.

    angles_deg: theta_i, theta_r and dphi, (N,) each. value: (N,), in 1/sr if `absolute`; those that
    are not above 0 are left out.
    """
    known = np.isfinite(value) & (value > 0)
    theta_i, theta_r, dphi = (angle[known] for angle in angles_deg)
    m = Measurements.bare(theta_i, theta_r, dphi, value[known], _U_FIT * value[known])
    if not absolute:
        m = replace(m, relative=True, free_levels=True)
    try:
        return _better_fit(m)
    except NotDetermined:
        return None


def _better_fit(m: Measurements) -> QuickFit:
    """Fit with each lobe.

    Unknown levels of the lamp need the shared errors of a full fit: a lobe would explain them.
    """
    fits = FirstFits(m)
    firsts = [fits.of(MODELS[f"{_BODY}+{lobe}"]) for lobe in _LOBES]
    if m.free_levels:
        full = min((refine(f, m, None, u="none") for f in firsts), key=lambda one: one.bic)
        return QuickFit(full.problem, full.x)
    best = min(firsts, key=lambda one: one.bic)
    return QuickFit(best.problem, best.solution.x)
