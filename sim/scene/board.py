"""Print of the calibration board and of markers: each pixel averages over its own area."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from instrument.board import DICTIONARY, MARGIN_SHARE, MARKER_SHARE, Board
from instrument.geometry import FloatArray
from instrument.pixel_coverage import Coverage

_INK = 0.06  # reflectance of black print relative to paper (assumed)
_TEXELS = 256  # of a square's side
_PARTS = 4  # of a pixel's side, over which it averages

FloatImage = NDArray[np.float32]


def print_on(board: Board, homography: FloatArray, outline: Coverage) -> FloatImage:
    """Return the reflectance of a board relative to paper, over the outline's crop.

    homography (3, 3): from the board in mm to the picture in pixels.
    """
    per_mm = _TEXELS / board.square_mm
    return _seen(_print(board), per_mm, board.size_mm, homography, outline)


def marker_on(number: int, side_mm: float, homography: FloatArray, outline: Coverage) -> FloatImage:
    """Return the reflectance of a marker with white around it relative to paper, likewise.

    side_mm: of the black square. homography (3, 3): from mm, from the middle of the marker.
    """
    size_mm = marker_size_mm(side_mm)
    per_mm = _TEXELS / size_mm
    return _seen(_marker(number), per_mm, (size_mm, size_mm), homography, outline)


def marker_size_mm(side_mm: float) -> float:
    """Return the side of a marker with the white around it, as it is cut out of a board."""
    return side_mm / MARKER_SHARE


def _seen(
    reflectance: FloatImage,
    per_mm: float,
    size_mm: tuple[float, float],
    homography: FloatArray,
    outline: Coverage,
) -> FloatImage:
    """Return a print (rows, columns) of `per_mm` texels as the pixels of a crop average it."""
    width_mm, height_mm = size_mm
    from_texel = np.array(
        [
            [1 / per_mm, 0, 0.5 / per_mm - width_mm / 2],
            [0, -1 / per_mm, height_mm / 2 - 0.5 / per_mm],
            [0, 0, 1.0],
        ]
    )
    half = (_PARTS - 1) / 2
    to_parts = np.array(
        [
            [_PARTS, 0, half - _PARTS * outline.column],
            [0, _PARTS, half - _PARTS * outline.row],
            [0, 0, 1.0],
        ]
    )
    rows, columns = outline.fraction.shape
    fine = cv2.warpPerspective(
        reflectance,
        to_parts @ homography @ from_texel,
        (_PARTS * columns, _PARTS * rows),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    mean = cv2.resize(fine, (columns, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(mean, dtype=np.float32)


@lru_cache(maxsize=1)
def _print(board: Board) -> FloatImage:
    """Return the reflectance of the board relative to paper, (rows, columns)."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
    drawn = cv2.aruco.CharucoBoard(
        (board.columns, board.rows), board.square_mm, MARKER_SHARE * board.square_mm, dictionary
    )
    width, height = (round(side / board.square_mm * _TEXELS) for side in board.size_mm)
    image = drawn.generateImage((width, height), marginSize=round(MARGIN_SHARE * _TEXELS))
    return np.asarray(_INK + (1 - _INK) / 255 * image, dtype=np.float32)


@lru_cache(maxsize=50)
def _marker(number: int) -> FloatImage:
    """Return the reflectance of a marker and its white relative to paper, (rows, columns)."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
    side = round(MARKER_SHARE * _TEXELS)
    image = np.full((_TEXELS, _TEXELS), 255, dtype=np.uint8)
    start = (_TEXELS - side) // 2
    image[start : start + side, start : start + side] = dictionary.generateImageMarker(number, side)
    return np.asarray(_INK + (1 - _INK) / 255 * image, dtype=np.float32)
