"""Reflectance map: radiance of a surface against its gradient (p, q)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from analysis.rendering.light import Light
from analysis.rendering.material import Material
from analysis.rendering.render import radiance
from analysis.rendering.surface import unit
from instrument.geometry import Brdf, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ReflectanceMap:
    """Radiance (Q, P) at gradients p = dz/dx (P,) and q = dz/dy (Q,); 0 where no lamp shines."""

    p: FloatArray
    q: FloatArray
    radiance: FloatArray

    @property
    def plane_r2(self) -> float:
        """R² of the best plane where p² + q² <= reach²: 1 for a linear map, as the moon's.

        Gradients that no lamp lights are left out. NaN where nothing is lit, or all of it alike.
        """
        p, q = np.meshgrid(self.p, self.q)
        lit = (self.radiance > 0) & (np.hypot(p, q) <= self.p[-1] * (1 + 1e-9))
        ones = np.ones(int(lit.sum()))
        values = self.radiance[lit]
        scatter = float(np.sum((values - values.mean()) ** 2)) if values.size else 0.0
        if scatter <= 1e-24 * float(np.sum(values**2)):
            return float("nan")
        plane = np.column_stack([ones, p[lit], q[lit]])
        left = values - plane @ np.linalg.lstsq(plane, values, rcond=None)[0]
        return 1 - float(left @ left) / scatter


def reflectance_map(
    brdf: Brdf | Material, lights: Iterable[Light], reach: float = 1.5, size: int = 101
) -> ReflectanceMap:
    """Return the map, of shape (size, size), of gradients from -reach to reach, which are ratios.

    Its radiance is per sr, times the unit of the irradiance.
    """
    steps = np.linspace(-reach, reach, size)
    p, q = np.meshgrid(steps, steps)
    normal = unit(np.stack([-p, -q, np.ones_like(p)], axis=-1))
    return ReflectanceMap(steps, steps, radiance(normal, brdf, lights))
