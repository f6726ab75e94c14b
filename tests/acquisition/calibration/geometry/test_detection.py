"""Detection of corners in pictures, and the words where a picture shows another board or none."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from acquisition.calibration.geometry.detection import find_corners, require_board
from instrument.board import Board
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray


def drawn(columns: int = 6, rows: int = 6, dictionary: int = cv2.aruco.DICT_4X4_50) -> FloatArray:
    """A picture in counts of 12 bits."""
    own = cv2.aruco.CharucoBoard(
        (columns, rows), 8.0, 6.0, cv2.aruco.getPredefinedDictionary(dictionary)
    )
    image = own.generateImage((columns * 64, rows * 64))
    padded = np.pad(image, 50, constant_values=255).astype(np.float64)
    return 200 + 3000 / 255 * np.asarray(cv2.GaussianBlur(padded, (0, 0), 1.0))


def test_corners_are_found_to_a_fiftieth_of_a_pixel_in_noise() -> None:
    noisy = drawn() + np.random.default_rng(1).normal(0, 20, (484, 484))
    seen = find_corners(noisy, Board())
    expected = Board().corners_mm()[seen.numbers] * [8, -8] + 49.5 + 192
    assert len(seen.numbers) == 25
    assert np.sqrt(np.mean((seen.pixels - expected) ** 2)) < 0.02


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_the_turn_of_the_board_is_told(quarters: int) -> None:
    seen = find_corners(np.rot90(drawn(), quarters).copy(), Board())
    assert (seen.turn_deg(Board()) - 90 * quarters + 180) % 360 - 180 == pytest.approx(0, abs=0.5)


@pytest.mark.parametrize(
    ("picture", "words"),
    [
        (drawn(dictionary=cv2.aruco.DICT_6X6_50), "markers of DICT_6X6_50; expected: DICT_4X4_50"),
        (np.full((480, 480), 300.0), "no markers of DICT_4X4_50 found. Look at a picture"),
        (drawn()[:, :140], "of 25 corners of 6 x 6 squares of 8 mm are seen; needed: 40 %"),
    ],
    ids=["dictionary", "nothing", "cut off"],
)
def test_a_picture_without_the_board_is_refused(picture: FloatArray, words: str) -> None:
    seen = find_corners(picture, Board())
    with pytest.raises(NotDetermined, match=words) as refused:
        require_board(picture, seen, Board(), "at theta_r 5 deg")
    assert str(refused.value).startswith("board at theta_r 5 deg: ")
