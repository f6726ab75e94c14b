"""Detection of a board's corners in a picture, to parts of a pixel, by OpenCV's module `aruco`."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from instrument.board import DICTIONARY, MARKER_SHARE, Board
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray, IntArray

LEAST_SHARE = 0.4  # of the corners, for a picture to count
_OTHERS = ("DICT_5X5_50", "DICT_6X6_50", "DICT_7X7_50", "DICT_ARUCO_ORIGINAL",
           "DICT_APRILTAG_36h11")  # fmt: skip
_REFINED = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)
_LEAST_REACH, _MOST_REACH = 2, 9  # pixels around a corner that are used
_BRIGHT = 99.5  # percentile


@dataclass(frozen=True, slots=True)
class Seen:
    """Corners in one picture: their numbers (n,) and pixels (n, 2), column first."""

    numbers: IntArray
    pixels: FloatArray

    def turn_deg(self, board: Board) -> float:
        """Return by how much the board is turned in the picture, anticlockwise, in degrees."""
        own = board.corners_mm()[self.numbers]
        a, b = own - own.mean(axis=0), self.pixels - self.pixels.mean(axis=0)
        b = b * [1.0, -1.0]
        return float(
            np.degrees(np.arctan2(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a * b)))
        )


def find_corners(image: FloatArray, board: Board) -> Seen:
    """Return the corners in a picture (rows, columns) in counts, none if there is no board."""
    found, numbers, _, _ = _detector(board).detectBoard(_as_bytes(image))
    if found is None or numbers is None or len(found) == 0:
        return Seen(np.zeros(0, dtype=np.int64), np.zeros((0, 2)))
    pixels = np.asarray(found, dtype=np.float32).reshape(-1, 2)
    own: IntArray = np.asarray(numbers).ravel().astype(np.int64)
    reach = _reach_px(pixels.astype(np.float64), own, board)
    refined = cv2.cornerSubPix(
        image.astype(np.float32), pixels.reshape(-1, 1, 2).copy(), (reach, reach), (-1, -1),
        _REFINED,
    )  # fmt: skip
    return Seen(own, np.asarray(refined, dtype=np.float64).reshape(-1, 2))


def require_board(image: FloatArray, seen: Seen, board: Board, where: str) -> None:
    """Raise `NotDetermined` if a picture does not show the board; `where`: its pose in words.

    image (rows, columns) in counts.
    """
    whole = (board.columns - 1) * (board.rows - 1)
    if seen.numbers.size >= max(4, LEAST_SHARE * whole):
        return
    picture = _as_bytes(image)
    for name in (DICTIONARY, *_OTHERS):
        markers = _markers(picture, name)
        if name != DICTIONARY and markers > 1:
            raise NotDetermined(
                f"board {where}: shows {markers} markers of {name}; expected: {DICTIONARY}. Lay "
                "the board of gonio calibrate board there"
            )
        if name == DICTIONARY and markers > 1:
            raise NotDetermined(
                f"board {where}: {markers} markers, but only {seen.numbers.size} of {whole} "
                f"corners of {board} are seen; needed: {100 * LEAST_SHARE:g} %. "
                "Compare --columns and --rows with the board, and look whether it lies in the "
                "picture, flat and lit"
            )
    raise NotDetermined(
        f"board {where}: no markers of {DICTIONARY} found. Look at a picture (gonio grab): is the "
        "board in the sample's place, lit, in focus, and this side up?"
    )


def _detector(board: Board) -> cv2.aruco.CharucoDetector:
    size = (board.columns, board.rows)
    marker_mm = MARKER_SHARE * board.square_mm
    own = cv2.aruco.CharucoBoard(size, board.square_mm, marker_mm, _dictionary(DICTIONARY))
    return cv2.aruco.CharucoDetector(own)


def _dictionary(name: str) -> cv2.aruco.Dictionary:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


def _markers(picture: np.ndarray, name: str) -> int:
    """Return the number of different markers of a dictionary in a picture of bytes."""
    _, numbers, _ = cv2.aruco.ArucoDetector(_dictionary(name)).detectMarkers(picture)
    return 0 if numbers is None else len(np.unique(numbers))


def _as_bytes(image: FloatArray) -> NDArray[np.uint8]:
    """Return a picture (rows, columns) in counts as bytes, stretched from dark to bright."""
    low, high = np.percentile(image, [0.5, _BRIGHT])
    scaled = (image - low) * (255 / max(float(high - low), 1e-9))
    return np.asarray(np.clip(np.rint(scaled), 0, 255), dtype=np.uint8)


def _reach_px(pixels: FloatArray, numbers: IntArray, board: Board) -> int:
    """Return the pixels around a corner in which there is no marker.

    pixels (n, 2). A marker begins an eighth of a square from the corner.
    """
    row, column = np.divmod(numbers, board.columns - 1)
    apart = np.hypot(*(pixels[:, np.newaxis] - pixels).transpose(2, 0, 1))
    steps = np.abs(row[:, np.newaxis] - row) + np.abs(column[:, np.newaxis] - column)
    next_to = apart[steps == 1]
    if next_to.size == 0:
        return _LEAST_REACH
    inset = (1 - MARKER_SHARE) / 2 * float(next_to.min())
    return int(np.clip(np.floor(inset), _LEAST_REACH, _MOST_REACH))
