"""Surface of a picture: its height and its normal in each pixel, seen along z."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from instrument.geometry import BoolArray, FloatArray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Surface:
    """Visible side of an object, pixel by pixel (R, C), in radii of the sphere.

    x (C,), y (R,): places of the pixels' centres, x rising to the right, y falling with the row.
    height: z (R, C), NaN beside the object. normal: unit vectors (R, C, 3), there NaN, too.
    convex: it casts no shadow on itself.
    """

    name: str
    x: FloatArray
    y: FloatArray
    height: FloatArray
    normal: FloatArray
    convex: bool

    @classmethod
    def from_height(
        cls, name: str, x: FloatArray, y: FloatArray, height: FloatArray, *, convex: bool = False
    ) -> Surface:
        """Return the surface of a height map (R, C), with normals from central differences.

        x (C,), y (R,) and height are in one unit, the radius of the sphere.
        """
        by_row, by_column = np.gradient(height, y, x)
        return cls(
            name=name,
            x=x,
            y=y,
            height=height,
            normal=unit(np.stack([-by_column, -by_row, np.ones_like(height)], axis=-1)),
            convex=convex,
        )

    @property
    def seen(self) -> BoolArray:
        """Mask (R, C) of the pixels in which the object is seen."""
        return np.asarray(np.isfinite(self.height) & np.isfinite(self.normal[..., 2]))

    @property
    def pixel(self) -> float:
        """Side of a pixel."""
        return float(self.x[1] - self.x[0])


def unit(vectors: FloatArray) -> FloatArray:
    """Return unit vectors: the vectors (..., 3) divided by their lengths."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
