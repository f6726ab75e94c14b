"""Independent reader of pab-opto text, by the C library's rules: fgets of 2048, sscanf, fscanf."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray

_BUFFER, _NAME_BUFFER = (
    2048,
    256,
)  # bytes: of a line, and of the name, in pabopto2bsdf.c and bsdfrep.c


@dataclass(frozen=True, slots=True)
class PabFile:
    """Name, incidence in degrees, kind of the values, and rows theta, phi, value (N, 3)."""

    name: str
    theta_phi: tuple[float, float]
    kind: str
    rows: FloatArray


def read_pab(content: bytes) -> PabFile:
    """Read as C does; lines of the header that do not fit into the buffer are an error."""
    head: dict[str, str] = {}
    place = 0
    while content[place : place + 1] == b"#":
        end = content.index(b"\n", place) + 1
        assert end - place < _BUFFER
        line = content[place + 1 : end].decode()
        for form in (r'(sample_name)\s*"([^"]+)"', r"(format): theta phi (\S+)", r"(in\w+) (\S+)"):
            if found := re.match(form, line):
                head[found[1]] = found[2]
        place = end
    assert len(head["sample_name"].encode()) < _NAME_BUFFER
    body = np.array(content[place:].split(), dtype=np.float64).reshape(-1, 3)
    incidence = float(head["intheta"]), float(head["inphi"])
    return PabFile(head["sample_name"], incidence, head["format"], body)
