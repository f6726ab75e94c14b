"""Interlock on the outlines of sample and white tile: they must be where the pose puts them.

A step motor that slipped, a sample that was never put in place of the tile: no device reports them,
the picture does. Edges without contrast or outside the picture say nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from acquisition.interlocks.picture.edges import find_edges, outward_normal
from acquisition.interlocks.picture.outline import (
    LIMIT_SIGMA,
    Comparison,
    Deviation,
    Estimate,
    Outline,
    Rectangle,
)
from acquisition.measure.radiometry import SATURATION_FRACTION
from acquisition.plan.plan import Step
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.devices import Surface
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole

# Standard uncertainties that neither rig nor protocol states: a scale measured with a steel rule.
U_SIZE_MM = 0.5  # of the surface's width and height
U_FIELD = 0.01  # relative, of `field_width_mm`
U_POSITION_MM = 1.0  # of a surface laid against marks by hand, at most: see `_u_position_mm`
U_ROLL_DEG = 0.3  # of `roll_deg`, as seen in a picture by eye
U_TILT_DEG = 0.2  # of the surface from the plane of the axis: 0.1 mm on its edge
_CERTAIN = 0.7  # share of a slip from whose limit on it was certainly absent: limits are estimates
U_AIM_MM = 0.2  # of the axis in the picture from one angle to another: a beam bends


@dataclass(frozen=True, slots=True)
class _Seen:
    """Step without a contradiction: number of the placement, and least slip that would be one."""

    step: int
    placement: int
    slip_limit_deg: float


@dataclass(slots=True)
class OutlineCheck:
    """Interlock on the outlines of the surfaces whose size is known.

    u: standard uncertainties by surface. What the pictures tell of a surface's place and size, and
    of the camera, counts until another surface takes its place. doubted: after a contradiction,
    steps before it in which it would not have been seen.
    """

    rig: Rig
    surfaces: Mapping[Surface, Rectangle]
    u: Mapping[Surface, Deviation]
    doubted: list[int] = field(default_factory=list)
    _placed: Surface | None = None
    _placements: int = 0
    _seen: list[_Seen] = field(default_factory=list)
    _known: Estimate = field(default_factory=lambda: Estimate.of(Deviation()))

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
        pinhole, camera = Pinhole.of(self.rig), self.rig.camera
        known = self._known if surface == self._placed else Estimate.of(self.u[surface])
        outline = Outline(pinhole, theta_r_deg, self.surfaces[surface], known)
        scale = pinhole.focal_px / pinhole.beam_length_mm
        range_dn = camera.black_level_dn, SATURATION_FRACTION * camera.max_dn
        corners = outline.corners_px()
        edges = find_edges(image, range_dn, corners, scale)
        if camera.dark_patch is not None:
            patch = pinhole.project(camera.dark_patch.corners_mm(), theta_r_deg).mean(axis=0)
            edges = [edge for edge in edges if not _faces(corners, edge.index, patch)]
        return Comparison(outline, edges)

    def contradiction(self, image: NDArray[Any], step: Step) -> str:
        """Return how an image (rows, columns) in DN contradicts the pose; empty if it does not."""
        surface, theta_r_deg = step.surface, step.pose.theta_r
        if surface not in self.surfaces:
            self._place(surface, Estimate.of(Deviation()))
            self._seen.append(_Seen(step.index, self._placements, float("inf")))
            return ""
        found = self.compare(image, surface, theta_r_deg)
        if not found.contradicts:
            self._place(surface, found.learnt() if found.edges else found.outline.known)
            self._seen.append(_Seen(step.index, self._placements, found.slip_limit_deg))
            return ""
        self.doubted = self._unseen_in(found, self._placements + (surface != self._placed))
        return (
            f"interlock outline: the {surface} ({found.outline.surface}) is not where theta_r "
            f"{theta_r_deg:g} deg puts it in the picture: {_edges_text(found)}; its angle, height, "
            "position and size and the scale of the picture are not so uncertain (chi2 "
            f"{found.chi2:.3g}, allowed {found.chi2_limit:.3g}). "
            f"{self._explanation(found, surface)}"
        )

    def _place(self, surface: Surface, known: Estimate) -> None:
        self._placements += surface != self._placed
        self._placed, self._known = surface, known

    def _unseen_in(self, found: Comparison, placement: int) -> list[int]:
        """Return the latest steps in which this contradiction would not have been seen.

        A slip may be older than the placement of the surface, all else not.
        """
        at, _, chi2 = found.with_free("theta_r_deg")
        slip_deg = abs(at.theta_r_deg) if chi2 <= found.chi2_limit else float("inf")
        steps = []
        for seen in reversed(self._seen):
            older = seen.placement < placement
            if seen.slip_limit_deg < _CERTAIN * slip_deg or (older and slip_deg == float("inf")):
                break
            steps.append(seen.step)
        return steps

    def _explanation(self, found: Comparison, surface: Surface) -> str:
        """Return what explains the edges, and what to look at."""
        for other in self.surfaces:
            if other == surface:
                continue
            known = Estimate.of(self.u[other])
            changed = replace(found.outline, surface=self.surfaces[other], known=known)
            if not Comparison(changed, found.edges).contradicts:
                return (
                    f"The {other} ({self.surfaces[other]}) would look like this: is it still on "
                    "the table?"
                )
        return _best_explanation(found)


def _faces(corners_px: FloatArray, index: int, point_px: FloatArray) -> bool:
    """Return True if a point (2,) outside a quadrilateral (4, 2) lies in front of that edge.

    The dark patch has an edge of its own there, which may be the more distinct one.
    """
    start = corners_px[index]
    along = corners_px[(index + 1) % 4] - start
    outside = float(np.dot(outward_normal(corners_px, index), point_px - start)) > 0
    return outside and 0 <= float(np.dot(along, point_px - start) / np.dot(along, along)) <= 1


def _uncertainty(rig: Rig, protocol: Protocol, surface: Rectangle) -> Deviation:
    position_mm = _u_position_mm(rig, protocol, surface)
    return Deviation(
        theta_r_deg=rig.axes["theta_r"].u_deg,
        column_mm=U_AIM_MM,
        row_mm=U_AIM_MM,
        x_mm=position_mm,
        y_mm=position_mm,
        turn_deg=float(np.degrees(position_mm / min(surface.width_mm, surface.height_mm))),
        z_mm=rig.u_placement_mm,
        lean_deg=U_TILT_DEG,
        tilt_deg=U_TILT_DEG,
        width_mm=U_SIZE_MM,
        height_mm=U_SIZE_MM,
        field=U_FIELD,
        roll_deg=U_ROLL_DEG,
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
