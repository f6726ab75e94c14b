"""Mean curve of a run as a map uses it: the model's fit, and the errors that all cells share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from acquisition.results.fitting import measurements
from acquisition.results.reduction import PLACEMENT, TEXTURE, Reduced
from analysis.data.acceptance import Acceptance, averaged_brdf
from analysis.data.covariance import full_covariance
from analysis.fit.fit import FitResult, fit
from analysis.fit.relative_scale import FACTOR_NAME, normalise_lamp_levels
from analysis.models import MODELS
from instrument.config.load import Loaded
from instrument.config.rig import Rig
from instrument.geometry import FloatArray, Geometry, lamp_direction
from instrument.record.reading import Reading

_RINGS = 3  # of lamp and lens


class Response(NamedTuple):
    """Answer of a cell's fit to errors of its K values, at its P parameters.

    inverse: (P, K), parameters by values; by_parameter: (K, P), the derivatives; level: (K,), the
    cell's BRDF over that of the mean curve.
    """

    inverse: FloatArray
    by_parameter: FloatArray
    level: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanCurve:
    """Fit of the window's mean at K valid points, and their values (K,) in 1/sr.

    brdf: less what lamp and lens average as they are not points; of relative measurements in the
    unit of the fit, with the lamp's levels divided out. u_own: (K,), relative, independent from
    point to point. shared: (K, M) in 1/sr, shifts by one u of each error that points share;
    by_height: (K, G), those of a surface off the axis by one u of the rig's placement, once it was
    placed. geometry: (K,).
    """

    fit: FitResult
    brdf: FloatArray
    u_own: FloatArray
    shared: FloatArray
    by_height: FloatArray
    geometry: Geometry
    relative: bool

    @classmethod
    def of(cls, reduced: Reduced, loaded: Loaded, model: str) -> MeanCurve:
        """Fit the model to the valid points; raises `NotDetermined` as `analysis.fit.fit` does."""
        acceptance = Acceptance.of(loaded.rig, loaded.protocol.window)
        found = fit(MODELS[model], measurements(reduced, loaded), acceptance)
        m = measurements(_of_cells(reduced, loaded.rig), loaded)
        m = normalise_lamp_levels(m, found.brdf)
        scale = found.values.get(FACTOR_NAME, 1.0)
        covariance = full_covariance(replace(m, free_levels=False), found.brdf)
        common = covariance.common_dense / scale
        placed = np.array([name.startswith(PLACEMENT) for name in covariance.names], dtype=bool)
        angles = m.theta_i_deg, m.theta_r_deg, m.dphi_deg
        averaged = averaged_brdf(found.brdf, *angles, acceptance, _RINGS, patch_nodes=1)
        return cls(
            fit=found,
            brdf=m.brdf / scale * found.brdf(m.geometry) / averaged,
            u_own=np.sqrt(covariance.variance) / np.abs(found.brdf(m.geometry)),
            shared=common[:, ~placed],
            by_height=common[:, placed],
            geometry=m.geometry,
            relative=m.relative,
        )

    @property
    def values(self) -> dict[str, float]:
        """Values of the model's own parameters."""
        return {n: v for n, v in self.fit.values.items() if n != FACTOR_NAME}

    def response(
        self, values: Mapping[str, float], variance: Callable[[FloatArray], FloatArray]
    ) -> Response:
        """Return how a cell's least squares answer errors, linearised at its values by parameter.

        variance: of BRDF (K,) in 1/sr, in 1/sr^2.
        """
        model = MODELS[self.fit.model]
        by = model.gradient(self.geometry, **values)
        J = np.stack([by[p.name] for p in model.parameters], axis=1)
        brdf = model.brdf(self.geometry, **values)
        weighted = J / variance(brdf)[:, np.newaxis]
        inverse = np.linalg.pinv(weighted.T @ J, hermitian=True) @ weighted.T
        return Response(inverse, J, brdf / model.brdf(self.geometry, **self.values))

    def u_shared(self, response: Response, height: float) -> FloatArray:
        """Return u of the parameters, (P,) in their units, by the errors that all cells share.

        height: u of the surface's height, in units of the rig's placement. Without a white tile
        the lamp's levels are those of the mean curve, and add its own u; and all values have an
        unknown factor, of which sigma depends by the light of two bounces.
        """
        shifts = response.inverse @ (self.errors(height) * response.level[:, np.newaxis])
        u = np.sqrt(np.sum(shifts**2, axis=1))
        if self.relative:
            u = np.hypot(u, [self.fit.u.get(name) or 0.0 for name in self.values])
        return np.asarray(u)

    def errors(self, height: float) -> FloatArray:
        """Return the shifts (K, M) of the mean curve, in 1/sr, by one u of each shared error.

        height: as in `u_shared`.
        """
        factor = self._u_factor() * MODELS[self.fit.model].brdf(self.geometry, **self.values)
        return np.hstack([self.shared, height * self.by_height, factor[:, np.newaxis]])

    def _u_factor(self) -> float:
        """Return the relative u of the factor of relative values: the albedo may be any."""
        known = self.fit.values.get("albedo", 0.0)
        return 1 / (np.sqrt(12) * known) if self.relative and known else 0.0


def _of_cells(reduced: Reduced, rig: Rig) -> Reduced:
    """Return the run with the uncertainties that its cells share.

    A surface off its place changes the window's mean by what lies at its edge, too. Cells are no
    part of that.
    """
    by_height = rig.u_placement_mm * light_by_height_per_mm(reduced.points, rig)
    shared = (
        replace(e, u_relative=by_height) if e.name == PLACEMENT else e for e in reduced.shared
    )
    components = {name: u for name, u in reduced.components.items() if name != TEXTURE}
    return replace(reduced, components=components, shared=tuple(shared))


def light_by_height_per_mm(readings: Sequence[Reading], rig: Rig) -> FloatArray:
    """Return the relative change, (K,) for each mm, of a place's light by the surface's height.

    It is seen tan(theta_r) of the height beside its place, where the lamp is nearer or farther.
    """
    theta_i, dphi, theta_r = (
        np.array([getattr(r, name) for r in readings])
        for name in ("theta_i_deg", "dphi_deg", "theta_r_deg")
    )
    x, _, z = np.moveaxis(lamp_direction(theta_i, dphi), -1, 0)
    nearer = 3 * (x * np.tan(np.radians(theta_r)) + z) - 1 / z
    return np.asarray(nearer / rig.lamp_distance_mm)
