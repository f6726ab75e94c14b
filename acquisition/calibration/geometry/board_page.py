"""Page with the board at its true size: a PDF of lines and surfaces, with a ruler to check it."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from instrument.board import DICTIONARY, MARKER_SHARE, Board
from instrument.errors import InputError

_A4_MM = (210.0, 297.0)
_MARGIN_MM = 15.0  # printers leave up to that much white
_BITS = 6  # of a marker's side: 4 and a black frame
_TEXT_PT, _LEAD_MM = 10.0, 5.5
_RULER_TICK_MM = (2.0, 3.5)  # of a millimetre, of ten
_DATE_OFF = {"CreationDate": None, "ModDate": None}  # equal boards are equal files

Rectangle = tuple[float, float, float, float]  # left, bottom, width, height, in mm


def board_pdf(board: Board) -> bytes:
    """Return the PDF of one page; raise `InputError` if the board does not fit on A4."""
    page = _page_mm(board)
    import matplotlib.collections
    from matplotlib.backends.backend_pdf import FigureCanvasPdf
    from matplotlib.figure import Figure

    figure = Figure(figsize=(page[0] / 25.4, page[1] / 25.4))
    FigureCanvasPdf(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0, page[0]), ylim=(0, page[1]))
    axes.set_axis_off()
    width, height = board.size_mm
    left, bottom = (page[0] - width) / 2, page[1] - _MARGIN_MM - 8 - height
    black = [(left + x, bottom + y, w, h) for x, y, w, h in black_mm(board)]
    corners = [[(x, y), (x + w, y), (x + w, y + h), (x, y + h)] for x, y, w, h in black]
    axes.add_collection(
        matplotlib.collections.PolyCollection(
            corners, facecolors="black", edgecolors="none", antialiaseds=False
        )
    )
    _outline(axes, (left, bottom, width, height))
    _ruler(axes, left, bottom - 12, width)
    _words(axes, board, bottom - 26)
    written = io.BytesIO()
    figure.savefig(written, format="pdf", metadata=_DATE_OFF)
    return written.getvalue()


def black_mm(board: Board) -> Iterator[Rectangle]:
    """Yield the black rectangles of a board, from the lower left of its margin."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
    side, size = board.square_mm, (board.columns, board.rows)
    margin = (board.size_mm[0] - board.columns * side) / 2
    bit = side * MARKER_SHARE / _BITS
    inset = side * (1 - MARKER_SHARE) / 2
    number = 0
    for row in range(size[1]):
        for column in range(size[0]):
            x, top = margin + column * side, margin + (size[1] - row) * side
            if (row + column) % 2 == 0:
                yield x, top - side, side, side
                continue
            cells = dictionary.generateImageMarker(number, _BITS)
            number += 1
            for line, start, end in _runs(np.asarray(cells) == 0):
                yield (
                    x + inset + start * bit,
                    top - inset - (line + 1) * bit,
                    (end - start) * bit,
                    bit,
                )


def _runs(black: np.ndarray) -> Iterator[tuple[int, int, int]]:
    """Yield row, start and end of each run of black cells of a marker (rows, columns)."""
    for row, cells in enumerate(np.pad(black, ((0, 0), (1, 1))).astype(int)):
        steps = np.flatnonzero(np.diff(cells))
        for start, end in steps.reshape(-1, 2).tolist():
            yield row, start, end


def _page_mm(board: Board) -> tuple[float, float]:
    """Return the size of the page: A4, upright or across."""
    width, height = board.size_mm
    for page in (_A4_MM, _A4_MM[::-1]):
        if width <= page[0] - 2 * _MARGIN_MM and height <= page[1] - 2 * _MARGIN_MM - 70:
            return page
    raise InputError(
        f"gonio calibrate board: {board} are {width:g} x {height:g} mm with the margin; allowed: "
        "what fits on A4 beside the ruler and the words, 180 x 197 mm or 267 x 110 mm"
    )


def _outline(axes: Any, box: Rectangle) -> None:
    """Draw marks outside the corners, along which the board is cut."""
    left, bottom, width, height = box
    for x, away in ((left, -1), (left + width, 1)):
        for y, up in ((bottom, -1), (bottom + height, 1)):
            axes.plot([x, x], [y + up, y + 5 * up], color="black", linewidth=0.3)
            axes.plot([x + away, x + 5 * away], [y, y], color="black", linewidth=0.3)


def _ruler(axes: Any, left: float, top: float, least_mm: float) -> None:
    """Draw a ruler of whole centimetres, at least 5 of them."""
    length = max(50, 10 * int(least_mm // 10))
    for mm in range(length + 1):
        tick = _RULER_TICK_MM[mm % 10 == 0]
        axes.plot([left + mm] * 2, [top, top - tick], color="black", linewidth=0.35)
        if mm % 10 == 0:
            axes.text(left + mm, top - 5, f"{mm}", ha="center", va="top", fontsize=8)
    axes.plot([left, left + length], [top, top], color="black", linewidth=0.35)
    axes.text(left + length + 4, top, "mm", ha="left", va="top", fontsize=8)


def _words(axes: Any, board: Board, top: float) -> None:
    for number, text in enumerate(instructions(board)):
        axes.text(_MARGIN_MM, top - _LEAD_MM * number, text, va="top", fontsize=_TEXT_PT)


def instructions(board: Board) -> Iterator[str]:
    """Yield the lines that stand on the page."""
    yield f"gonio calibration board: {board}, markers {DICTIONARY}, ids from 0 at the top left"
    yield "1. Print at 100 % (actual size, no fitting to the page) on matt paper."
    yield "2. Lay a ruler along the one above. If it differs, measure the squares over the board's"
    yield "    whole width, divide, and give that side as --square-mm to gonio calibrate geometry."
    yield "3. Glue the sheet flat on a rigid plate as thick as the sample, and cut it at the marks."
    yield "4. Lay it in the sample's place, this side up, its middle on the rotation axis, and its"
    yield "    upper edge to the side that is up in the picture at theta_r 0."
