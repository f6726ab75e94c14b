"""Independent reader of Zemax tabular BSDF: words in turn, as libbsdf reads, and its directions."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray

_AXES = ("SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial")


@dataclass(frozen=True, slots=True)
class ZemaxFile:
    """Texts of the header, axes in degrees by name, TIS (I,), values (I, A, R) and comments."""

    texts: dict[str, str]
    axes: dict[str, list[float]]
    tis: FloatArray
    brdf: FloatArray
    comments: list[str]

    def angles(self, n: int) -> tuple[FloatArray, FloatArray]:
        """Theta_r and dphi (A, R) in degrees of incidence n, by turning the specular frame."""
        theta_i = np.radians(self.axes["AngleOfIncidence"][n])
        axes = (np.radians(self.axes[name]) for name in ("ScatterAzimuth", "ScatterRadial"))
        azimuth, radial = np.meshgrid(*axes, indexing="ij")
        x, y, z = np.sin(radial) * np.cos(azimuth), np.sin(radial) * np.sin(azimuth), np.cos(radial)
        x, z = (  # about y, so that the pole comes to the mirror side
            x * np.cos(theta_i) - z * np.sin(theta_i),
            x * np.sin(theta_i) + z * np.cos(theta_i),
        )
        return np.degrees(np.arccos(np.clip(z, -1, 1))), np.degrees(np.arctan2(y, x))


def read_zemax(text: str) -> ZemaxFile:
    """Read the words of all lines that are no comments."""
    lines = text.split("\n")
    words = iter(re.findall(r"\S+", "\n".join(line for line in lines if not line.startswith("#"))))
    texts: dict[str, str] = {}
    axes: dict[str, list[float]] = {}
    for word in words:
        if word == "Monochrome":
            break
        if word in _AXES:
            axes[word] = [float(next(words)) for _ in range(int(next(words)))]
        else:
            texts[word] = next(words)
    assert next(words) == "DataBegin"
    shape = tuple(len(axes[name]) for name in _AXES[1:])
    tis, values = [], []
    for _ in range(shape[0]):
        assert next(words) == "TIS"
        tis.append(float(next(words)))
        values.append([float(next(words)) for _ in range(shape[1] * shape[2])])
    assert list(words) == ["DataEnd"]
    comments = [line[2:] for line in lines if line.startswith("#")]
    return ZemaxFile(texts, axes, np.array(tis), np.reshape(values, shape), comments)
