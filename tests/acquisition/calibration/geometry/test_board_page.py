"""Page with the board: its rectangles are the board that is looked for, at true size."""

from __future__ import annotations

import re

import numpy as np
import pytest

from acquisition.calibration.geometry.board_page import black_mm, board_pdf, instructions
from acquisition.calibration.geometry.detection import find_corners
from instrument.board import Board
from instrument.errors import InputError

PX_PER_MM = 12


@pytest.mark.parametrize("board", [Board(), Board(columns=7, rows=5, square_mm=4.0)], ids=str)
def test_the_black_rectangles_show_every_corner_in_its_place(board: Board) -> None:
    width, height = (round(side * PX_PER_MM) for side in board.size_mm)
    page = np.full((height, width), 255.0)
    for left, bottom, across, up in black_mm(board):
        columns = slice(round(left * PX_PER_MM), round((left + across) * PX_PER_MM))
        rows = slice(height - round((bottom + up) * PX_PER_MM), height - round(bottom * PX_PER_MM))
        page[rows, columns] = 0
    seen = find_corners(np.pad(page, 40, constant_values=255), board)
    assert seen.numbers.tolist() == list(range((board.columns - 1) * (board.rows - 1)))
    expected = board.corners_mm() * [1, -1] * PX_PER_MM + [width / 2 + 39.5, height / 2 + 39.5]
    assert seen.pixels == pytest.approx(expected, abs=0.1)


def test_the_page_is_a4_and_has_no_date_by_which_it_would_differ_each_time() -> None:
    written = board_pdf(Board())
    assert b"Date" not in written
    box = re.search(rb"/MediaBox \[([^]]*)\]", written)
    assert box
    assert [float(n) for n in box[1].split()] == pytest.approx([0, 0, 595.28, 841.89], abs=0.01)


def test_the_words_name_the_board_and_the_option_for_a_wrong_print() -> None:
    words = " ".join(instructions(Board()))
    assert "6 x 6 squares of 8 mm" in words
    assert "--square-mm" in words


def test_a_board_that_leaves_the_page_is_refused() -> None:
    with pytest.raises(InputError, match="300 mm with the margin; allowed: what fits on A4"):
        board_pdf(Board(square_mm=48.0))
