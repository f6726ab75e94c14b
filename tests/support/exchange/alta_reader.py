"""Independent reader of ALTA text: a key is the first word after #, rows are streams of numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray


@dataclass(frozen=True, slots=True)
class AltaFile:
    """Names of the parametrisations, kind of the radius, and rows (N, numbers)."""

    inputs: str
    outputs: str
    segment: int
    rows: FloatArray


def read_alta(text: str) -> AltaFile:
    """Read as ALTA's vertical_segment::load does: later keys overwrite earlier ones."""
    keys: dict[str, list[str]] = {}
    rows = []
    for line in text.split("\n"):
        if line.startswith("#"):
            name, *values = [*line[1:].split(), ""]
            keys[name] = values
        elif line:
            rows.append([float(word) for word in line.split()])
    segment = int(keys.get("VS", ["0"])[0])
    count = int(keys["DIM"][0]) + int(keys["DIM"][1]) + segment
    assert all(len(row) == count for row in rows)
    return AltaFile(keys["PARAM_IN"][0], keys["PARAM_OUT"][0], segment, np.array(rows))
