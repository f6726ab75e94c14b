"""Material of a picture: a model with its parameters, evaluated quickly enough for pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from analysis.models import MODELS
from analysis.models.base import Model, named_terms
from analysis.models.lambert import LAMBERT
from analysis.models.rough.oren_nayar_exact import OREN_NAYAR_EXACT
from analysis.rendering.angles import local_geometry, longitudes
from instrument.geometry import Brdf, FloatArray, Geometry

_COSTLY = (OREN_NAYAR_EXACT.name,)  # 20 to 40 us a geometry, where a closed form takes 0.2
_STEPS = 33  # of longitude and of latitude in the table of a costly term
_FEW = 2 * _STEPS**2  # normals, up to which a costly term is evaluated at each of them
_NODES = 96  # of the reflectance at normal incidence
_EDGE = 1e-4  # of the table: on it lamp or camera would graze, and at the poles both


@dataclass(frozen=True, slots=True)
class Material:
    """Model, its parameters, and its name in a picture."""

    model: Model
    parameters: Mapping[str, float]
    name: str

    @classmethod
    def named(cls, model: str, **parameters: float) -> Material:
        """Return the material of a model of `MODELS`; its name is that of the model."""
        return cls(MODELS[model], parameters, model)

    def brdf(self, geometry: Geometry) -> FloatArray:
        """Return the BRDF in 1/sr, of the geometry's shape, as the model computes it."""
        return self.model.brdf(geometry, **self.parameters)

    @property
    def albedo(self) -> float:
        """The model's `albedo`; of a model without one, its reflectance at normal incidence."""
        known = self.parameters.get("albedo")
        return self._normal_reflectance() if known is None else float(known)

    @property
    def lambert(self) -> Brdf:
        """Lambert's BRDF of the same albedo, also above 1, to be called as `Model.brdf` with it."""
        return partial(LAMBERT.kernel, albedo=self.albedo)

    def _normal_reflectance(self) -> float:
        """Share of light at normal incidence that is reflected, to any side.

        By Gauss's rule with its nodes close together towards the normal, where a lobe is narrow.
        """
        t, weights = np.polynomial.legendre.leggauss(_NODES)
        t, weights = (t + 1) / 2, weights / 2
        theta = np.pi / 2 * t**3
        ring = np.pi * np.sin(2 * theta) * (3 * np.pi / 2 * t**2)
        geometry = Geometry.from_degrees(theta_i=0.0, theta_r=np.degrees(theta))
        return float(np.sum(weights * ring * self.brdf(geometry)))

    def reflected(self, normal: FloatArray, to_lamp: FloatArray) -> FloatArray:
        """Return BRDF x cos(theta_i) (N,) for a viewer along z, a lamp (3,) and normals (N, 3).

        All face both. Terms that are integrals are interpolated in a table of normals, which is
        accurate to what a picture shows: 0.1 % in the median, 1 % of the peak near an edge.
        """
        found = np.zeros(len(normal))
        for term in named_terms(self.model):
            own = {p.name: self.parameters[p.name] for p in term.parameters}
            if term.name in _COSTLY and len(normal) > _FEW:
                found += _interpolated(term, own, normal, to_lamp)
            else:
                found += _evaluated(term, own, normal, to_lamp)
        return found


def _evaluated(
    term: Model, own: Mapping[str, float], normal: FloatArray, to_lamp: FloatArray
) -> FloatArray:
    brdf = term.brdf(local_geometry(normal, to_lamp), **own)
    return np.asarray(brdf * (normal @ to_lamp))


def _interpolated(
    term: Model, own: Mapping[str, float], normal: FloatArray, to_lamp: FloatArray
) -> FloatArray:
    """BRDF x cos(theta_i) (N,) between the nodes of a grid of longitude and latitude.

    The nodes lie closer together towards grazing light, grazing view and the poles.
    """
    longitude, latitude, phase = longitudes(normal, to_lamp)
    start, width = phase - np.pi / 2, np.pi - phase
    nodes = np.linspace(0.0, 1.0, _STEPS)
    around = start + width * np.clip((1 - np.cos(np.pi * nodes)) / 2, _EDGE, 1 - _EDGE)
    up = (np.pi / 2) * np.minimum(1 - (1 - nodes) ** 2, 1 - _EDGE)
    x, y = np.meshgrid(around, up, indexing="ij")
    grid = np.stack([np.cos(y) * np.sin(x), np.sin(y), np.cos(y) * np.cos(x)], axis=-1)
    lamp = np.array([np.sin(phase), 0.0, np.cos(phase)])
    table = _evaluated(term, own, grid.reshape(-1, 3), lamp).reshape(_STEPS, _STEPS)
    row = np.arccos(np.clip(1 - 2 * (longitude - start) / width, -1, 1)) / np.pi
    column = 1 - np.sqrt(np.maximum(1 - latitude / (np.pi / 2), 0.0))
    return _bilinear(table, row * (_STEPS - 1), column * (_STEPS - 1))


def _bilinear(table: FloatArray, row: FloatArray, column: FloatArray) -> FloatArray:
    """Values (N,) between the nodes of a table (S, S), at places (N,) counted in its steps."""
    last = len(table) - 2
    i, j = (np.clip(place.astype(np.intp), 0, last) for place in (row, column))
    down, right = row - i, column - j
    upper = table[i, j] * (1 - right) + table[i, j + 1] * right
    lower = table[i + 1, j] * (1 - right) + table[i + 1, j + 1] * right
    return np.asarray(upper * (1 - down) + lower * down)
