"""Detection of markers beside the sample, and the shift of the plate that they are on.

The surroundings of each marker are mapped back to the plane of the sample first, where the marker
is a square again: OpenCV's module `aruco` then finds it at grazing view, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from instrument.board import DICTIONARY
from instrument.config.protocol import Markers
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole

_SIDE_PX = 60  # of a marker, mapped back
_REACH = 1.0  # how far a marker is looked for, in its sides
_BRIGHT = 99.0  # percentile of the surroundings: paper
_CORNERS = np.array([[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]])  # as aruco orders them


@dataclass(frozen=True, slots=True)
class PlateShift:
    """Shift of a plate in its plane, in mm, at the rotation axis, and its turn anticlockwise.

    A plate that lies above the axis seems shifted as well: in x by minus its height times
    tan(theta_r).
    markers: how many were seen.
    """

    x_mm: float
    y_mm: float
    turn_deg: float
    markers: int

    def to_table(self) -> FloatArray:
        """Return the matrix (3, 3) from points (x, y, 1) of the plate, in mm, to the table's."""
        c, s = np.cos(np.radians(self.turn_deg)), np.sin(np.radians(self.turn_deg))
        return np.array([[c, -s, self.x_mm], [s, c, self.y_mm], [0, 0, 1.0]])


def plate_shift(
    image: NDArray[Any],
    theta_r_deg: float,
    pinhole: Pinhole,
    markers: Markers,
    turn_deg: float = 0.0,
) -> PlateShift | None:
    """Return the shift of the plate in a picture (rows, columns) in counts; None if none is seen.

    theta_r_deg: signed view angle. turn_deg: of the plate, where a single marker is seen. A marker
    that is farther from its place than its side is not seen.
    """
    found = list(_seen(image, theta_r_deg, pinhole, markers))
    if not found:
        return None
    own, seen = (np.concatenate(corners) for corners in zip(*found, strict=True))
    turn = _turn(own, seen) if len(found) > 1 else float(np.radians(turn_deg))
    c, s = np.cos(turn), np.sin(turn)
    shift = seen.mean(axis=0) - np.array([[c, -s], [s, c]]) @ own.mean(axis=0)
    return PlateShift(float(shift[0]), float(shift[1]), float(np.degrees(turn)), len(found))


def known_place(
    image: NDArray[Any], theta_r_deg: float, pinhole: Pinhole, markers: Markers
) -> PlateShift | None:
    """Return the shift and the turn of the plate in a picture (rows, columns) in counts.

    theta_r_deg: signed view angle. None where fewer than two markers are seen, which tell no turn.
    """
    shift = plate_shift(image, theta_r_deg, pinhole, markers)
    return shift if shift is not None and shift.markers > 1 else None


def _turn(own: FloatArray, seen: FloatArray) -> float:
    """Return the angle in radians by which points (N, 2) are turned, in the least squares."""
    a, b = own - own.mean(axis=0), seen - seen.mean(axis=0)
    return float(np.arctan2(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a * b)))


def _seen(
    image: NDArray[Any], theta_r_deg: float, pinhole: Pinhole, markers: Markers
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield for each marker that is seen its corners (4, 2) in mm as stated, and where they are."""
    homography = pinhole.homography(theta_r_deg)
    per_mm = _SIDE_PX / markers.size_mm
    side = round(_SIDE_PX * (1 + 2 * _REACH))
    half = (side - 1) / 2
    for number, centre in enumerate(markers.centres_mm):
        x, y = centre
        to_plane = np.array(
            [[1 / per_mm, 0, x - half / per_mm], [0, -1 / per_mm, y + half / per_mm], [0, 0, 1.0]]
        )
        flat = cv2.warpPerspective(
            image, homography @ to_plane, (side, side),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        )  # fmt: skip
        corners = _corners_px(flat, number)
        if corners is not None:
            seen = (corners - half) * [1 / per_mm, -1 / per_mm] + centre
            yield np.asarray(centre + markers.size_mm * _CORNERS), np.asarray(seen)


def _corners_px(flat: NDArray[Any], number: int) -> FloatArray | None:
    """Return the corners (4, 2) of a marker in a picture of its surroundings, None without it."""
    low, high = np.percentile(flat, [100 - _BRIGHT, _BRIGHT])
    if high <= low:
        return None
    stretched = (flat.astype(np.float32) - low) * (255 / (high - low))
    picture = np.asarray(np.clip(stretched, 0, 255), dtype=np.uint8)  # paper may be brighter
    corners, numbers, _ = _detector().detectMarkers(picture)
    if not corners:
        return None
    own = [found for found, seen in zip(corners, numbers.ravel(), strict=True) if seen == number]
    return np.asarray(own[0], dtype=np.float64).reshape(4, 2) if len(own) == 1 else None


@lru_cache(maxsize=1)
def _detector() -> cv2.aruco.ArucoDetector:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
    return cv2.aruco.ArucoDetector(dictionary, parameters)
