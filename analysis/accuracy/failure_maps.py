"""Where each approximation fails: what it is off its exact method, at most, cell by cell.

What to use when: `analysis.accuracy.cheapest.cheapest` to have a method chosen; the `bound`s of
`analysis.accuracy.method` for one method's error; this module to make the file anew, with
`python -m analysis.accuracy.failure_maps` (four minutes on one core of 2 GHz).

`failure_maps.npz` holds relative errors as levels of one byte, rounded up:

=========  ===========================================  ========================================
map        cells over                                   of
=========  ===========================================  ========================================
rough      sigma, larger angle, smaller over larger,    Lambert, (36), (33)+(34), the table
           dphi (the grid of `departure`)               `departure`, and the coarse rule
smooth     n, sqrt(1 - rho), angle of one ray           Chandrasekhar's H of some orders: the
                                                        lamp's ray, and the camera's with its K
lobe       ln g, ln q of `beckmann_spizzichino`         the sum's limits g << 1 and g >> 1, its
                                                        first 10 and 100 terms; relative, and
                                                        absolute for wings that nothing can see
=========  ===========================================  ========================================

A cell's value is the largest error found in it, its corners included, and a margin for what lies
between: a share of how much the error changes there (a form), or half as much again as the
largest of the cell and its neighbours (rounding and quadrature, which are not smooth).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from itertools import pairwise, product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.models.rough.form_error import grid, integral
from analysis.models.rough.oren_nayar import (
    lambert_brdf,
    oren_nayar_brdf,
    oren_nayar_qualitative_brdf,
)
from analysis.models.rough.oren_nayar_exact import COARSE, forget, oren_nayar_exact_brdf
from analysis.models.smooth.wolff import ray_terms
from analysis.models.specular.beckmann_spizzichino import poisson_sum
from instrument.geometry import FloatArray, Geometry

Levels = NDArray[np.uint8]

FILE = Path(__file__).with_name("failure_maps.npz")

ROUGH = ("lambert", "qualitative", "functional", "table", "coarse")
"""Methods of the rough surface that have a map, in its order."""
ORDERS = (1, 2, 3, 4, 6, 8, 12, 16)
"""Orders of Chandrasekhar's H that have a map."""
TERMS = (10, 100)
LOBE = ("smooth", "rough", *(f"{count} terms" for count in TERMS))
"""Methods of the lobe that have a map, in its order."""

_MARGIN = 0.15  # of what a form's error changes within a cell
_UNEVEN = 1.5  # what the largest error of a quadrature found is multiplied with
_REFERENCE = 1e-6  # relative error of the rule that the rough maps are made with
_DARKEST = 1e-9  # in place of an albedo of 0, at which a relative error is a limit


class Scale(NamedTuple):
    """How errors stand in a byte: 0 is `least` or less, then `per_octave` levels a doubling."""

    least: float
    per_octave: int

    def levels(self, errors: FloatArray) -> Levels:
        """Bytes of errors, rounded up; 255 is without limit."""
        octaves = np.log2(np.maximum(errors, self.least) / self.least)
        return np.minimum(np.ceil(octaves * self.per_octave - 1e-9), 255).astype(np.uint8)

    def errors(self, levels: Levels) -> FloatArray:
        """Errors of bytes: no smaller than what was put in."""
        found = self.least * np.exp2(levels / self.per_octave)
        return np.where(levels == 255, np.inf, found)


RELATIVE = Scale(1e-8, 8)
ABSOLUTE = Scale(1e-22, 3)


def smooth_grid() -> dict[str, FloatArray]:
    """Edges of the smooth dielectric's cells: n, root = sqrt(1 - rho), theta_deg of a ray."""
    return {
        "n": np.array([1.0, 1.01, 1.03, 1.07, 1.15, 1.25, 1.4, 1.6, 1.8, 2.1, 2.5, 3.0]),
        "root": np.linspace(0, 1, 13) ** 1.5,
        "theta_deg": 90 * (1 - np.linspace(1, 0, 25) ** 1.5),
    }


def lobe_grid() -> dict[str, FloatArray]:
    """Edges of the lobe's cells: ln g and ln q. The first cells reach down to 0."""
    return {
        "ln_g": np.log(np.geomspace(1e-6, 1e7, 131)),
        "ln_q": np.log(np.geomspace(1e-4, 1e8, 121)),
    }


@cache
def maps() -> Mapping[str, Levels]:
    """The maps: `rough` (method, sigma, larger, ratio, dphi), `smooth_lamp`, `smooth_camera`
    (order, n, root, theta), `lobe`, `lobe_absolute` (method, ln g, ln q).
    """
    with np.load(FILE) as file:
        found: dict[str, Levels] = {name: file[name] for name in file.files}
    for levels in found.values():
        levels.setflags(write=False)  # the cache hands it to everyone
    return found


def computed() -> dict[str, Levels]:
    """All maps, made anew."""
    lamp, camera = _smooth_maps()
    relative, absolute = lobe_maps()
    return {
        "rough": RELATIVE.levels(_rough_maps()),
        "smooth_lamp": RELATIVE.levels(lamp),
        "smooth_camera": RELATIVE.levels(camera),
        "lobe": RELATIVE.levels(relative),
        "lobe_absolute": ABSOLUTE.levels(absolute),
    }


def write(file: Path = FILE) -> None:
    """Compute the maps and keep them."""
    np.savez_compressed(file, allow_pickle=False, **computed())


# The rough surface.


def _rough_maps(samples: int = 40) -> FloatArray:
    """Largest errors of ROUGH in each cell of `departure.grid`, over all albedos."""
    random = np.random.default_rng(11)
    nodes = grid()
    sigma_deg = nodes.pop("sigma_deg")
    cells = list(pairwise(sigma_deg))
    shape = tuple(axis.size - 1 for axis in nodes.values())
    found = np.zeros((len(ROUGH), len(cells), *shape))
    for first in range(shape[0]):  # of the larger angle: a slice of cells at a time
        angles = _sampled(nodes, first, samples, random)
        geometry = Geometry.from_degrees(
            theta_i=angles[0], theta_r=angles[0] * angles[1], dphi=angles[2]
        )
        for row, (low, high) in enumerate(cells):
            at = [low, *(low + (high - low) * np.array([0.2, 0.5, 0.8])), high]
            errors = np.stack([_rough_errors(geometry, sigma) for sigma in at], axis=-1)
            found[:, row, first] = _of_cells(errors)
        forget()
    for k in (ROUGH.index("table"), ROUGH.index("coarse")):
        found[k] = _UNEVEN * _neighbours(found[k]) + _REFERENCE
    return found


def _sampled(
    nodes: Mapping[str, FloatArray], first: int, samples: int, random: np.random.Generator
) -> list[FloatArray]:
    """Larger, ratio and dphi, each (ratio cell, dphi cell, sample): corners, edges, inside."""
    larger, ratio, dphi = nodes.values()
    corners = np.array(list(product((0.0, 1.0), repeat=3)))
    inside = random.uniform(0, 1, (samples, 3))
    inside[::4, 1] = 1.0  # equal angles, where the surface has a cusp
    inside[1::4, 2] = np.round(inside[1::4, 2])  # the plane of incidence
    part = np.concatenate([corners, inside])
    i, j = np.meshgrid(np.arange(ratio.size - 1), np.arange(dphi.size - 1), indexing="ij")

    def within(axis: FloatArray, cell: NDArray[np.intp], column: int) -> FloatArray:
        low, high = axis[cell][..., None], axis[cell + 1][..., None]
        return np.asarray(low + (high - low) * part[:, column])

    return [within(larger, np.full_like(i, first), 0), within(ratio, i, 1), within(dphi, j, 2)]


def _rough_errors(geometry: Geometry, sigma_deg: float) -> FloatArray:
    """Signed errors (method, albedo, ...): between the two albedos they are monotone."""
    each = []
    for albedo in (_DARKEST, 1.0):
        exact = oren_nayar_exact_brdf(geometry, albedo, sigma_deg)
        forms = (
            lambert_brdf(geometry, albedo),
            oren_nayar_qualitative_brdf(geometry, albedo, sigma_deg),
            oren_nayar_brdf(geometry, albedo, sigma_deg),
            integral(geometry, albedo, sigma_deg),
            oren_nayar_exact_brdf(geometry, albedo, sigma_deg, COARSE),
        )
        each.append(np.stack(forms) / exact - 1)
    return np.stack(each, axis=1)


def _of_cells(errors: FloatArray) -> FloatArray:
    """Bound of each cell from signed errors (method, albedo, ..., sample, sigma)."""
    spread = np.ptp(errors, axis=(-2, -1))
    return np.asarray((np.abs(errors).max(axis=(-2, -1)) + _MARGIN * spread).max(axis=1))


def _neighbours(errors: FloatArray) -> FloatArray:
    """The largest of each cell and those about it."""
    from scipy.ndimage import maximum_filter

    return np.asarray(maximum_filter(errors, size=3, mode="nearest"))


# The smooth dielectric.


def _smooth_maps(parts: int = 3) -> tuple[FloatArray, FloatArray]:
    """Largest |ln| of (approximate / exact) of the lamp's and of the camera's ray, each cell."""
    n, root, theta_deg = (_finer(axis, parts) for axis in smooth_grid().values())
    theta = np.radians(theta_deg)
    lamp = np.empty((len(ORDERS), n.size, root.size, theta.size))
    camera = np.empty_like(lamp)
    for i, j in product(range(n.size), range(root.size)):
        rho = float(max(1 - root[j] ** 2, _DARKEST))
        exact_H, exact_rest = ray_terms(theta, rho, float(n[i]))
        for k, order in enumerate(ORDERS):
            H, rest = ray_terms(theta, rho, float(n[i]), order)
            lamp[k, i, j] = np.log(H / exact_H)
            camera[k, i, j] = np.log(H * exact_rest / (exact_H * rest))
    return _coarser(lamp, parts, 3), _coarser(camera, parts, 3)


# The lobe.


def lobe_maps(parts: int = 4) -> tuple[FloatArray, FloatArray]:
    """Largest relative and absolute errors of the sum's LOBE methods in each cell."""
    grid = lobe_grid()
    g, q = (np.exp(_finer(_from_zero(axis), parts)) for axis in grid.values())
    g, q = np.meshgrid(g, q, indexing="ij")
    exact = poisson_sum(g, q, lambda m, *_: 1 / m)
    off = np.stack([found - exact for found in lobe_sums(g, q)])
    tiny = np.maximum(exact, np.finfo(np.float64).tiny)
    relative = np.minimum(np.abs(off) / tiny, 1e300) * np.sign(off)
    return _coarser(relative, parts, 2), _coarser(off, parts, 2)


def lobe_sums(g: FloatArray, q: FloatArray) -> Iterator[FloatArray]:
    """The sum in `lobe_brdf` by each of LOBE, in turn."""
    with np.errstate(under="ignore", over="ignore"):
        yield g * np.exp(-g - q)
        yield np.exp(-q / g) / g
        total, poisson = np.zeros(g.shape), np.exp(-g)
        for term in range(1, max(TERMS) + 1):
            poisson = poisson * (g / term)
            total = total + poisson * np.exp(-q / term) / term
            if term in TERMS:
                yield total


def _from_zero(ln_edges: FloatArray) -> FloatArray:
    """Edges of which the first stands for 0."""
    return np.concatenate([[ln_edges[0] - 40.0], ln_edges[1:]])


def _finer(edges: FloatArray, parts: int) -> FloatArray:
    """Each cell in so many parts."""
    position = np.arange((edges.size - 1) * parts + 1) / parts
    return np.interp(position, np.arange(edges.size), edges)


def _coarser(signed: FloatArray, parts: int, axes: int) -> FloatArray:
    """Bound of each cell from signed errors at the nodes of `_finer`, over the last `axes`."""
    windows = np.lib.stride_tricks.sliding_window_view(
        signed, (parts + 1,) * axes, tuple(range(-axes, 0))
    )
    every = (slice(None),) * (signed.ndim - axes) + (slice(None, None, parts),) * axes
    nodes = windows[every]
    over = tuple(range(-axes, 0))
    return np.asarray(np.abs(nodes).max(axis=over) + _MARGIN * np.ptp(nodes, axis=over))


if __name__ == "__main__":
    write()
