"""Edges of a bright or dark quadrilateral in an image, with sub-pixel accuracy.

Brightness is sampled along normals of each expected edge. Only steps that stand out of the
surface's texture and noise count; a straight line is fitted to them without outliers. An edge
without contrast, or one that leaves the image, is not reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from instrument.geometry import BoolArray, FloatArray

_STATIONS = 96  # along an edge; brightness is a median over three of them
_INDEPENDENT = 8  # of the stations: coarse texture moves many of them together
_LEAST_STATIONS = 24  # fewer show no straight line with certainty
_FLANK = 5  # pixels averaged on each side of a step
_GAP = 2  # pixels left out on both sides of a step: lens blur spreads it over 3 or 4 pixels
_MARGIN = 2 * (_FLANK + _GAP)  # pixels that a profile needs on each side of the expected edge
_LEAST_REACH = 60  # pixels that a profile reaches outwards
_LEAST_LENGTH = 28  # pixels of an edge: shorter ones have no certain direction
_CORNER = 4  # pixels left out at both ends of an edge, where another one is near
_NOISE_RATIO = 8.0  # of a step to the median fluctuation: none of 4 x 96 x 600 samples of noise
_LEAST_CONTRAST = 0.05  # of the brightest part: weaker steps may be shadows or stray light
_LEAST_DN = 3.0  # counts: smaller steps may be rounding, whose noise is not seen in equal counts
_LIKE_LARGEST = 0.5  # of the profile's largest step: smaller ones are texture
_LEAST_SHARE = 0.6  # of the stations that must agree on a line
_MAX_SCATTER_MM = 0.5  # of the stations about the line: a frayed edge has no place


@dataclass(frozen=True, slots=True)
class FoundEdge:
    """Edge of number `index` in the expected outline: it joins corners `index` and `index` + 1.

    `points_px` (2, 2): two points on the expected edge as (column, row). `offsets_px` (2,):
    distance of the found edge from them, outwards, in pixels; `u_px`: standard uncertainty of each
    by the scatter of the stations.
    """

    index: int
    points_px: FloatArray
    normal: FloatArray
    offsets_px: FloatArray
    u_px: float


def find_edges(
    image: NDArray[Any], range_dn: tuple[float, float], corners_px: FloatArray, px_per_mm: float
) -> list[FoundEdge]:
    """Return the edges found near those of an expected convex quadrilateral.

    `image` (rows, columns) in DN, dark at the first of `range_dn` and not trusted from the second;
    `corners_px` (4, 2) as (column, row), in order around the quadrilateral.
    """
    found = (_find_edge(image, range_dn, corners_px, index, px_per_mm) for index in range(4))
    return [edge for edge in found if edge is not None]


def _find_edge(
    image: NDArray[Any],
    range_dn: tuple[float, float],
    corners_px: FloatArray,
    index: int,
    px_per_mm: float,
) -> FoundEdge | None:
    start, end = corners_px[index], corners_px[(index + 1) % 4]
    normal = outward_normal(corners_px, index)
    length = float(np.linalg.norm(end - start))
    if length < _LEAST_LENGTH:
        return None
    trimmed = max(0.04, _CORNER / length)
    share = np.linspace(trimmed, 1 - trimmed, _STATIONS)
    stations = start + share[:, np.newaxis] * (end - start)
    stations = stations[_inside(stations, image.shape, _MARGIN)]
    across = float(np.dot(normal, start - corners_px.mean(axis=0)))  # to the middle
    if len(stations) < _LEAST_STATIONS or across < 1.2 * _MARGIN:
        return None
    steps = _Profiles.of(image, range_dn, stations, normal, across).steps()
    return _fit_line(index, stations, normal, steps, _MAX_SCATTER_MM * px_per_mm)


def outward_normal(corners_px: FloatArray, index: int) -> FloatArray:
    """Return the unit vector (2,) normal to an edge of a convex quadrilateral (4, 2), outwards."""
    along = corners_px[(index + 1) % 4] - corners_px[index]
    normal = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    outwards: FloatArray = normal * np.sign(
        np.dot(normal, corners_px[index] - corners_px.mean(axis=0))
    )
    return outwards


def _inside(points_px: FloatArray, shape: Sequence[int], margin_px: float) -> BoolArray:
    """Return which points (N, 2) lie in an image of that shape, a margin away from its border."""
    high = np.array([shape[1] - 1, shape[0] - 1]) - margin_px
    inside: BoolArray = np.all((points_px >= margin_px) & (points_px <= high), axis=1)
    return inside


@dataclass(frozen=True, slots=True)
class _Profiles:
    """Brightness in DN above black, (stations, M), at `distance_px` (M,) outwards of the edge.

    From `saturated_dn` above black the blur of a step is cut off, and its place is not known.
    """

    brightness: NDArray[np.float32]
    distance_px: FloatArray
    saturated_dn: float

    @classmethod
    def of(
        cls,
        image: NDArray[Any],
        range_dn: tuple[float, float],
        stations: FloatArray,
        normal: FloatArray,
        across_px: float,
    ) -> _Profiles:
        """Sample an image at the stations (N, 2) in pixels: from near the middle to outwards."""
        import cv2

        reach = np.floor(0.9 * across_px)
        distance = np.arange(-reach, max(reach, _LEAST_REACH) + 1)
        columns, rows = (
            np.add.outer(at.astype(np.float32), (distance * slope).astype(np.float32))
            for at, slope in zip(stations.T, normal, strict=True)
        )
        sampled = cv2.remap(
            image, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        ).astype(np.float32)
        black_dn, saturated_dn = range_dn
        brightness = cv2.medianBlur(sampled, 3) - np.float32(black_dn)
        return cls(brightness, distance, saturated_dn - black_dn)

    def steps(self) -> FloatArray:
        """Return the place of the step in each profile, (stations,), in pixels; nan for none.

        Of the steps that stand out the one nearest to the expected edge counts.
        """
        import cv2

        change = self._change()
        size = np.abs(change)
        noise = self._fluctuation(size[::3])
        bright = float(np.percentile(self.brightness[::3], 95))
        least = np.maximum(
            max(_NOISE_RATIO * noise, _LEAST_CONTRAST * bright, _LEAST_DN),
            _LIKE_LARGEST * size.max(axis=1, keepdims=True),
        )
        peak = size >= cv2.dilate(size, np.ones((1, 2 * (_FLANK + _GAP) + 1), np.uint8))
        distance = np.where(peak & (size >= least), np.abs(self.distance_px), np.inf)
        nearest = np.argmin(distance, axis=1)
        places = self._place(nearest)
        places[~np.isfinite(distance.min(axis=1))] = np.nan
        return places

    def _fluctuation(self, size: NDArray[np.float32]) -> float:
        """Return the standard deviation of changes (stations, M) in DN, on the uneven side.

        From the lower quartile: a step fills more than half of a short side.
        """
        sides = size[:, self.distance_px < 0], size[:, self.distance_px > 0]
        return max(float(np.percentile(side, 25)) for side in sides) / 0.3186  # if normal

    def _change(self) -> NDArray[np.float32]:
        """Return the mean inside minus the mean outside of each sample, (stations, M)."""
        import cv2

        flank = np.full(_FLANK, 1.0 / _FLANK)
        kernel = np.concatenate([flank, np.zeros(2 * _GAP + 1), -flank])[np.newaxis]
        changed = cv2.filter2D(self.brightness, cv2.CV_32F, kernel, borderType=cv2.BORDER_REPLICATE)
        return np.asarray(changed, dtype=np.float32)

    def _place(self, nearest: NDArray[np.intp]) -> FloatArray:
        """Return where a sharp step has the area of the blurred one around each sample."""
        reach = _FLANK + _GAP
        centre = np.clip(nearest, reach, len(self.distance_px) - 1 - reach)
        window = centre[:, np.newaxis] + np.arange(-reach, reach + 1)
        near = np.take_along_axis(self.brightness, window, axis=1).astype(np.float64)
        inside = near[:, :_FLANK].mean(axis=1)
        outside = near[:, -_FLANK:].mean(axis=1)
        unknown = (inside == outside) | (near.max(axis=1) >= self.saturated_dn)
        contrast = np.where(unknown, np.nan, inside - outside)
        filled = (near - outside[:, np.newaxis]).sum(axis=1) / contrast
        place: FloatArray = self.distance_px[centre] - reach - 0.5 + filled
        return place


def _fit_line(
    index: int, stations: FloatArray, normal: FloatArray, steps: FloatArray, max_scatter_px: float
) -> FoundEdge | None:
    """Return the straight line through the steps of most stations, if they agree on one."""
    import cv2

    along = np.linalg.norm(stations - stations[0], axis=1)
    used = np.isfinite(steps)
    for _ in range(4):
        if used.sum() < _LEAST_SHARE * len(stations):
            return None
        points = np.column_stack([along[used], steps[used]]).astype(np.float32)
        dx, dy, x, y = cv2.fitLine(points, cv2.DIST_HUBER, 0, 0.01, 0.01).ravel().tolist()
        if abs(dx) < abs(dy):
            return None
        line = y + (along - x) * dy / dx
        scatter = 1.4826 * float(np.median(np.abs(steps[used] - line[used])))
        before, used = used, np.isfinite(steps) & (np.abs(steps - line) <= max(3 * scatter, 0.05))
        if np.array_equal(before, used):
            break
    if scatter > max_scatter_px or used.sum() < _LEAST_SHARE * len(stations):
        return None
    ends = [0, -1]
    u_px = 2 * scatter / np.sqrt(_INDEPENDENT)
    return FoundEdge(index, stations[ends], normal, line[ends], float(u_px))
