"""Maker of `error_maps.npz`: the largest error of each approximate method, cell by cell.

`python -m acquisition.benchmark.maps.make_error_maps` computes it (a minute on one core of
2 GHz). Its reader, `analysis.models.error_maps`, describes the file and the margins.
"""

from __future__ import annotations

from itertools import pairwise, product
from pathlib import Path

import numpy as np

from acquisition.benchmark.maps import smooth_dielectric
from acquisition.benchmark.maps.smooth_dielectric import ORDERS
from analysis.models.error_maps import FILE, Levels, levels_of
from analysis.models.lambert import DARKEST, lambert_brdf
from analysis.models.rough import form_error_table
from analysis.models.rough.form_bounds import MAPPED
from analysis.models.rough.form_error_table import tabulated_brdf
from analysis.models.rough.oren_nayar_exact import (
    COARSE,
    clear_profile_cache,
    oren_nayar_exact_brdf,
)
from analysis.models.rough.oren_nayar_forms import oren_nayar_brdf, oren_nayar_qualitative_brdf
from analysis.models.smooth.wolff import ray_terms
from instrument.geometry import FloatArray, Geometry, IntArray

_MARGIN = 0.15  # of the change of a form's error within a cell
_UNEVEN = 1.5  # factor on the largest error found of a quadrature
_REFERENCE = 1e-6  # relative error of the rule that the rough maps are made with


def error_maps() -> dict[str, Levels]:
    """All maps, in levels of one byte; axes as in `analysis.models.error_maps.maps`."""
    return {n: levels_of(errors) for n, errors in {"rough": _rough_maps(), **smooth_maps()}.items()}


def write(file: Path = FILE) -> None:
    """Compute the maps and store them."""
    np.savez_compressed(file, allow_pickle=False, **error_maps())


# The rough surface.


def _rough_maps(samples: int = 40) -> FloatArray:
    """Largest errors of MAPPED in each cell of the table's grid, over all albedos."""
    random = np.random.default_rng(11)
    sigma_deg, *axes = form_error_table.GRID.values()
    cells = list(pairwise(sigma_deg))
    shape = tuple(axis.size - 1 for axis in axes)
    found = np.zeros((len(MAPPED), len(cells), *shape))
    for first in range(shape[0]):  # of the larger angle: a slice of cells at a time
        angles = _sampled(axes, first, samples, random)
        geometry = Geometry.from_degrees(
            theta_i=angles[0], theta_r=angles[0] * angles[1], dphi=angles[2]
        )
        for row, (low, high) in enumerate(cells):
            at = [low, *(low + (high - low) * np.array([0.2, 0.5, 0.8])), high]
            errors = np.stack([_rough_errors(geometry, sigma) for sigma in at], axis=-1)
            found[:, row, first] = _of_cells(errors)
        clear_profile_cache()
    for k in (MAPPED.index("table"), MAPPED.index("coarse")):
        found[k] = _UNEVEN * _neighbours(found[k]) + _REFERENCE
    return found


def _sampled(
    axes: list[FloatArray], first: int, samples: int, random: np.random.Generator
) -> list[FloatArray]:
    """Larger, ratio and dphi, each (ratio cell, dphi cell, sample): corners, edges, inside."""
    larger, ratio, dphi = axes
    corners = np.array(list(product((0.0, 1.0), repeat=3)))
    inside = random.uniform(0, 1, (samples, 3))
    inside[::4, 1] = 1.0  # equal angles, where the surface has a cusp
    inside[1::4, 2] = np.round(inside[1::4, 2])  # the plane of incidence
    part = np.concatenate([corners, inside])
    i, j = np.meshgrid(np.arange(ratio.size - 1), np.arange(dphi.size - 1), indexing="ij")

    def within(axis: FloatArray, cell: IntArray, column: int) -> FloatArray:
        low, high = axis[cell][..., None], axis[cell + 1][..., None]
        return np.asarray(low + (high - low) * part[:, column])

    return [within(larger, np.full_like(i, first), 0), within(ratio, i, 1), within(dphi, j, 2)]


def _rough_errors(geometry: Geometry, sigma_deg: float) -> FloatArray:
    """Signed errors (method, albedo, ...): between the two albedos they are monotone."""
    each = []
    for albedo in (DARKEST, 1.0):
        exact = oren_nayar_exact_brdf(geometry, albedo, sigma_deg)
        forms = (
            lambert_brdf(geometry, albedo),
            oren_nayar_qualitative_brdf(geometry, albedo, sigma_deg),
            oren_nayar_brdf(geometry, albedo, sigma_deg),
            tabulated_brdf(geometry, albedo, sigma_deg),
            oren_nayar_exact_brdf(geometry, albedo, sigma_deg, COARSE),
        )
        each.append(np.stack(forms) / exact - 1)
    return np.stack(each, axis=1)


def _of_cells(errors: FloatArray) -> FloatArray:
    """Bound of each cell from signed errors (method, albedo, ..., sample, sigma)."""
    spread = np.ptp(errors, axis=(-2, -1))
    return np.asarray((np.abs(errors).max(axis=(-2, -1)) + _MARGIN * spread).max(axis=1))


def _neighbours(errors: FloatArray) -> FloatArray:
    """Largest error of each cell and its neighbours."""
    from scipy.ndimage import maximum_filter

    return np.asarray(maximum_filter(errors, size=3, mode="nearest"))


# The smooth dielectric.


def smooth_maps(parts: int = 3) -> dict[str, FloatArray]:
    """Largest |ln| of (approximate / exact) of the lamp's and of the camera's ray, each cell.

    Each (order, n, root, theta), with a cell's errors found at `parts` + 1 values of an axis.
    """
    n, root, theta_deg = (_finer(axis, parts) for axis in smooth_dielectric.GRID.values())
    theta = np.radians(theta_deg)
    lamp = np.empty((len(ORDERS), n.size, root.size, theta.size))
    camera = np.empty_like(lamp)
    for i, j in product(range(n.size), range(root.size)):
        rho = float(max(1 - root[j] ** 2, DARKEST))
        exact_H, exact_rest = ray_terms(theta, rho, float(n[i]))
        for k, order in enumerate(ORDERS):
            H, rest = ray_terms(theta, rho, float(n[i]), order)
            lamp[k, i, j] = np.log(H / exact_H)
            camera[k, i, j] = np.log(H * exact_rest / (exact_H * rest))
    return {"smooth_lamp": _coarser(lamp, parts), "smooth_camera": _coarser(camera, parts)}


def _finer(edges: FloatArray, parts: int) -> FloatArray:
    """Edges with each cell divided into that many parts."""
    position = np.arange((edges.size - 1) * parts + 1) / parts
    return np.interp(position, np.arange(edges.size), edges)


def _coarser(signed: FloatArray, parts: int) -> FloatArray:
    """Bound of each cell from signed errors at the nodes of `_finer`, over the last three axes."""
    over = (-3, -2, -1)
    windows = np.lib.stride_tricks.sliding_window_view(signed, (parts + 1,) * 3, over)
    nodes = windows[:, ::parts, ::parts, ::parts]
    return np.asarray(np.abs(nodes).max(axis=over) + _MARGIN * np.ptp(nodes, axis=over))


if __name__ == "__main__":
    write()
