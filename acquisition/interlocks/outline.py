"""Outline of sample and white tile in the picture: it must be where the pose puts it.

The edges of a flat rectangle show the view angle (foreshortening, and the perspective between the
near and the far edge), and which surface lies on the table. A step motor that slipped, a sample
that was never put in place of the tile: no device reports them, the picture does.

Edges without contrast or outside the picture say nothing. What is found is compared with what is
expected by all edges together, within the uncertainties of the rig file and of what it leaves open.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from acquisition.interlocks.edges import FoundEdge, find_edges
from acquisition.measure.radiometry import SATURATION_FRACTION
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.devices import Surface
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole, rectangle_mm

LIMIT_SIGMA = 6.0
"""Probability of stopping a series without a fault, 2e-9: a scan may have 1e5 series."""
# Chi2 of two values for each edge that is exceeded as rarely (scipy.stats.chi2.isf).
CHI2_LIMITS = {2: 40.09, 4: 46.46, 6: 51.88, 8: 56.80}
# Standard uncertainties that neither rig nor protocol states: a scale measured with a steel rule.
U_SIZE_MM = 0.5  # of the surface's width and height
U_FIELD = 0.01  # relative, of `field_width_mm`
U_ROLL_DEG = 0.3  # of `roll_deg`, as seen in a picture by eye
U_TILT_DEG = 0.2  # of the surface from the plane of the axis: 0.1 mm on its edge
U_POSITION_MM = 1.0  # of a surface laid against marks by hand, at most: see `_u_position_mm`
U_EDGE_PX = 0.1  # of an edge: lens distortion and blur; in a simulated picture it is below this
_FREE = 1e3  # standard uncertainty in deg or mm of a parameter to be found
_LEAST_EDGES = 2  # one edge alone may be that of something else


@dataclass(frozen=True, slots=True)
class Rectangle:
    """Flat rectangular surface, centred on the rotation axis, and its size in mm."""

    width_mm: float
    height_mm: float

    def __str__(self) -> str:
        return f"{self.width_mm:.4g} x {self.height_mm:.4g} mm"


@dataclass(frozen=True, slots=True)
class Deviation:
    """Departure of a real outline from the expected one, or its standard uncertainty.

    theta_r_deg: of the view angle. x_mm, y_mm, turn_deg: of the surface in its plane. z_mm: of its
    height. width_mm, height_mm: of its size. field: relative, of the camera's field width.
    roll_deg: of the camera about its axis. tilt_deg: of the surface about its x axis.
    """

    theta_r_deg: float = 0.0
    x_mm: float = 0.0
    y_mm: float = 0.0
    turn_deg: float = 0.0
    z_mm: float = 0.0
    width_mm: float = 0.0
    height_mm: float = 0.0
    field: float = 0.0
    roll_deg: float = 0.0
    tilt_deg: float = 0.0

    @classmethod
    def of(cls, values: FloatArray) -> Self:
        """Return the deviation with these values (10,), in the order and units of the fields."""
        return cls(*values.tolist())

    @property
    def values(self) -> FloatArray:
        """Values (10,) in the order of the fields; units as in their names."""
        return np.array([getattr(self, name) for name in _NAMES])


_NAMES = tuple(Deviation.__dataclass_fields__)


@dataclass(frozen=True)
class Outline:
    """Expected outline of a surface in the picture; `u`: standard uncertainty of its parameters."""

    pinhole: Pinhole
    theta_r_deg: float
    surface: Rectangle
    u: Deviation

    def corners_px(self, deviation: Deviation = Deviation()) -> FloatArray:
        """Return the corners (4, 2) of a surface that deviates, in pixels as (column, row)."""
        d = deviation
        field_mm = self.pinhole.field_width_mm * (1 + d.field)
        roll_deg = self.pinhole.roll_deg + d.roll_deg
        pinhole = replace(self.pinhole, field_width_mm=field_mm, roll_deg=roll_deg)
        corners = rectangle_mm(self.surface.width_mm + d.width_mm,
                               self.surface.height_mm + d.height_mm)  # fmt: skip
        turn = np.radians(d.turn_deg)
        rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        moved = corners @ rotation + np.array([d.x_mm, d.y_mm])
        theta_r_deg = self.theta_r_deg + d.theta_r_deg
        low, high = (pinhole.project(moved, theta_r_deg, d.z_mm + z) for z in (0.0, 1.0))
        raised_mm = moved[:, 1:] * np.tan(np.radians(d.tilt_deg))
        tilted: FloatArray = low + raised_mm * (high - low)
        return tilted

    def offsets_px(self, edges: Sequence[FoundEdge], deviation: Deviation) -> FloatArray:
        """Return the offsets (M,) in pixels, two for each edge, of a surface that deviates."""
        corners = self.corners_px(deviation)
        return np.concatenate([_crossings(corners, edge) for edge in edges])

    def gradient(self, edges: Sequence[FoundEdge], at: Deviation) -> FloatArray:
        """Return the derivatives (M, 10) of the offsets, in pixels per unit of the deviation."""
        steps = np.diag([1e-4 if name == "field" else 0.01 for name in _NAMES])
        columns = [
            (self.offsets_px(edges, Deviation.of(at.values + step))
             - self.offsets_px(edges, Deviation.of(at.values - step))) / (2 * step.sum())
            for step in steps
        ]  # fmt: skip
        return np.column_stack(columns)


def _crossings(corners: FloatArray, edge: FoundEdge) -> FloatArray:
    start = corners[edge.index]
    along = corners[(edge.index + 1) % 4] - start
    normal = np.array([along[1], -along[0]])
    distance: FloatArray = (start - edge.points_px) @ normal / np.dot(edge.normal, normal)
    return distance


@dataclass(frozen=True)
class Comparison:
    """Found edges compared with an expected outline."""

    outline: Outline
    edges: Sequence[FoundEdge]

    @cached_property
    def found_px(self) -> FloatArray:
        """Offsets (M,) of the found edges in pixels, outwards."""
        return np.concatenate([edge.offsets_px for edge in self.edges])

    @cached_property
    def _variance_px2(self) -> FloatArray:
        """Variance (M,) of the found offsets in pixels squared."""
        return np.repeat([edge.u_px**2 + U_EDGE_PX**2 for edge in self.edges], 2)

    @cached_property
    def _covariance_px2(self) -> FloatArray:
        """Covariance (M, M) of the found offsets about the expected ones, by all that is u."""
        by_parameter = self.outline.gradient(self.edges, Deviation()) * self.outline.u.values
        covariance: FloatArray = by_parameter @ by_parameter.T + np.diag(self._variance_px2)
        return covariance

    @cached_property
    def chi2(self) -> float:
        """Sum of squares of the offsets in standard uncertainties, 2 for each edge."""
        residual = self.found_px - self.outline.offsets_px(self.edges, Deviation())
        return float(residual @ np.linalg.solve(self._covariance_px2, residual))

    @property
    def chi2_limit(self) -> float:
        """Largest allowed chi2."""
        return CHI2_LIMITS[len(self.found_px)]

    @property
    def contradicts(self) -> bool:
        """True if the surface cannot be where the pose puts it."""
        return len(self.edges) >= _LEAST_EDGES and self.chi2 > self.chi2_limit

    def with_free(self, *names: str) -> tuple[Deviation, Deviation, float]:
        """Return the deviation that fits with these parameters free, its u, and its chi2."""
        u = replace(self.outline.u, **dict.fromkeys(names, _FREE)).values
        weights, values = 1 / self._variance_px2, np.zeros(len(u))
        prior = np.diag(1 / np.maximum(u, 1e-9) ** 2)
        for _ in range(12):
            at = Deviation.of(values)
            gradient = self.outline.gradient(self.edges, at)
            residual = self.found_px - self.outline.offsets_px(self.edges, at)
            normal = gradient.T @ (weights[:, np.newaxis] * gradient) + prior
            step = np.linalg.solve(normal, gradient.T @ (weights * residual) - prior @ values)
            values = values + np.clip(step, -10, 10)
        at = Deviation.of(values)
        residual = self.found_px - self.outline.offsets_px(self.edges, at)
        chi2 = float(residual @ (weights * residual) + values @ prior @ values)
        return at, Deviation.of(np.sqrt(np.diag(np.linalg.inv(normal)))), chi2


@dataclass(frozen=True, slots=True)
class OutlineCheck:
    """Interlock on the outlines of the surfaces whose size is known; `u` by surface."""

    rig: Rig
    surfaces: Mapping[Surface, Rectangle]
    u: Mapping[Surface, Deviation]

    @classmethod
    def of(cls, rig: Rig, protocol: Protocol) -> Self:
        """Return the check of a scan; it knows no surface where the protocol states none."""
        surfaces: dict[Surface, Rectangle] = {}
        sample, tile = protocol.sample, protocol.references.white_tile
        if sample.outline == "rectangle":
            surfaces["sample"] = Rectangle(sample.width_mm, sample.height_mm)
        if tile is not None and tile.width_mm is not None and tile.height_mm is not None:
            surfaces["white tile"] = Rectangle(tile.width_mm, tile.height_mm)
        u = {name: _uncertainty(rig, protocol, size) for name, size in surfaces.items()}
        return cls(rig, surfaces, u)

    def compare(self, image: NDArray[Any], surface: Surface, theta_r_deg: float) -> Comparison:
        """Find the edges of a known surface in an image (rows, columns) in DN."""
        pinhole = Pinhole.of(self.rig)
        outline = Outline(pinhole, theta_r_deg, self.surfaces[surface], self.u[surface])
        scale = pinhole.focal_px / pinhole.beam_length_mm
        camera = self.rig.camera
        range_dn = camera.black_level_dn, SATURATION_FRACTION * camera.max_dn
        return Comparison(outline, find_edges(image, range_dn, outline.corners_px(), scale))

    def contradiction(self, image: NDArray[Any], surface: Surface, theta_r_deg: float) -> str:
        """Return how an image (rows, columns) in DN contradicts the pose; empty if it does not."""
        if surface not in self.surfaces:
            return ""
        found = self.compare(image, surface, theta_r_deg)
        if not found.contradicts:
            return ""
        return (
            f"interlock outline: the {surface} ({found.outline.surface}) is not where theta_r "
            f"{theta_r_deg:g} deg puts it in the picture: {_edges_text(found)}; its angle, height, "
            "position and size and the scale of the picture are not so uncertain (chi2 "
            f"{found.chi2:.3g}, allowed {found.chi2_limit:.3g}). "
            f"{self._explanation(found, surface)}"
        )

    def _explanation(self, found: Comparison, surface: Surface) -> str:
        """Return what explains the edges, and what to look at."""
        others = [name for name in self.surfaces if name != surface]
        for other in others:
            changed = replace(found.outline, surface=self.surfaces[other], u=self.u[other])
            if not Comparison(changed, found.edges).contradicts:
                return (
                    f"The {other} ({self.surfaces[other]}) would look like this: is it still on "
                    "the table?"
                )
        return _best_explanation(found)


def _uncertainty(rig: Rig, protocol: Protocol, surface: Rectangle) -> Deviation:
    position_mm = _u_position_mm(rig, protocol, surface)
    return Deviation(
        theta_r_deg=float(np.hypot(rig.axes["theta_r"].u_deg, U_TILT_DEG)),
        x_mm=position_mm,
        y_mm=position_mm,
        turn_deg=float(np.degrees(position_mm / min(surface.width_mm, surface.height_mm))),
        z_mm=rig.u_placement_mm,
        width_mm=U_SIZE_MM,
        height_mm=U_SIZE_MM,
        field=U_FIELD,
        roll_deg=U_ROLL_DEG,
        tilt_deg=U_TILT_DEG,
    )


def _u_position_mm(rig: Rig, protocol: Protocol, surface: Rectangle) -> float:
    """Return u of the surface's position: the measured patch must not reach past its edge."""
    window = protocol.window
    room_mm = min(surface.width_mm - window.width_mm, surface.height_mm - window.height_mm) / 2
    return min(U_POSITION_MM, max(room_mm / LIMIT_SIGMA, rig.u_placement_mm))


def _edges_text(found: Comparison) -> str:
    """Return the edges that were found, and how far off their farther end is, in mm at the axis."""
    pinhole = found.outline.pinhole
    mm = pinhole.beam_length_mm / pinhole.focal_px
    words = []
    for edge in found.edges:
        offset_mm = max(edge.offsets_px * mm, key=abs)
        way = "out" if offset_mm > 0 else "in"
        words.append(f"{_side(edge.normal)} edge {abs(offset_mm):.2f} mm too far {way}")
    return ", ".join(words)


def _side(normal: FloatArray) -> str:
    """Return the side of the picture to which an outward normal (2,) points."""
    column, row = normal.tolist()
    if abs(column) > abs(row):
        return "right" if column > 0 else "left"
    return "lower" if row > 0 else "upper"


def _best_explanation(found: Comparison) -> str:
    """Return the view angle, place and size that would look like this, and what to look at."""
    fits = {names: found.with_free(*names) for names in _EXPLANATIONS}
    best = min(chi2 for _, _, chi2 in fits.values())
    texts = [
        _EXPLANATIONS[names](found.outline, at, u)
        for names, (at, u, chi2) in fits.items()
        if chi2 <= min(best + LIMIT_SIGMA**2, found.chi2_limit)
    ]
    if texts:
        return "; or: ".join(texts)
    return (
        "No view angle, place or size of a rectangle explains it: look at what lies on the table; "
        "for a sample that is not a thin rectangle write `outline: none` into the protocol's sample"
    )


def _angle_text(outline: Outline, at: Deviation, u: Deviation) -> str:
    return (
        f"The picture is that of theta_r {outline.theta_r_deg + at.theta_r_deg:.1f} deg (u "
        f"{u.theta_r_deg:.1g}): look whether the stage slips or has lost its reference, and "
        "whether the surface is tilted"
    )


def _place_text(_outline: Outline, at: Deviation, _u: Deviation) -> str:
    return (
        f"A surface {np.hypot(at.x_mm, at.y_mm):.1f} mm off its place and turned by "
        f"{abs(at.turn_deg):.1f} deg would look like this: look whether it has moved"
    )


def _size_text(outline: Outline, at: Deviation, _u: Deviation) -> str:
    surface = outline.surface
    seen = Rectangle(surface.width_mm + at.width_mm, surface.height_mm + at.height_mm)
    return (
        f"A surface of {seen} would look like this: look what lies on the table, and measure the "
        "size that the protocol states"
    )


_EXPLANATIONS = {
    ("theta_r_deg",): _angle_text,
    ("x_mm", "y_mm", "turn_deg"): _place_text,
    ("width_mm", "height_mm"): _size_text,
}
