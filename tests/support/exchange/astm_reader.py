"""Independent reader of ASTM E1392 text: looks for its words one by one, as libbsdf does."""

from __future__ import annotations

import re

import numpy as np

from instrument.geometry import FloatArray


def read_astm(text: str) -> tuple[int, list[str], FloatArray]:
    """Return the stated number of points, the columns' names, and the numbers (N, columns)."""
    count, place = -1, 0
    for word in re.finditer(r"\S+", text):
        if word[0] == "NUM_POINTS":
            count = int(text[word.end() :].split(maxsplit=1)[0])
        if word[0] == "VARS":
            place = word.end() + 1
            break
    names, _, body = text[place:].partition("\n")
    rows = [[float(cell) for cell in line.split(",")] for line in body.split("\n") if line]
    return count, names.split(","), np.array(rows)
