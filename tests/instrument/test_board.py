"""Board: its corners are those of OpenCV's, and impossible sizes are refused."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from instrument.board import DICTIONARY, MARKER_SHARE, Board
from instrument.errors import InputError


@pytest.mark.parametrize(("columns", "rows", "side"), [(6, 6, 8.0), (7, 5, 3.5), (4, 9, 20.0)])
def test_corners_are_numbered_and_placed_as_opencv_has_them(
    columns: int, rows: int, side: float
) -> None:
    own = Board(columns=columns, rows=rows, square_mm=side)
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
    theirs = cv2.aruco.CharucoBoard((columns, rows), side, MARKER_SHARE * side, dictionary)
    corners = np.asarray(theirs.getChessboardCorners())[:, :2] * [1, -1]
    middle = np.array([-columns * side / 2, rows * side / 2])
    assert own.corners_mm() == pytest.approx(corners + middle)


def test_the_usual_board_is_as_large_as_a_usual_sample() -> None:
    assert Board().size_mm == (50.0, 50.0)


@pytest.mark.parametrize(
    ("sizes", "words"),
    [
        ({"columns": 2}, "--columns 2; allowed: 3 to 33 squares"),
        ({"rows": 40}, "--rows 40; allowed"),
        ({"columns": 12, "rows": 10}, "120 squares; allowed: 100, as there are 50 markers"),
        ({"square_mm": 0.1}, "--square-mm 0.1; allowed: 0.5 to 200 mm"),
        ({"square_mm": float("nan")}, "--square-mm nan; allowed"),
    ],
)
def test_sizes_of_no_board_are_refused(sizes: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        Board(**sizes)  # type: ignore[arg-type] - either kind of number
