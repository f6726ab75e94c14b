"""Sensor of a few lines: Poisson electrons, normal read noise, a curve, rounding; its levels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.calibration.level_series import LevelSeries

Array = NDArray[np.float64]


def proportional(share: Array) -> Array:
    return share


@dataclass(kw_only=True)
class SensorModel:
    """A sensor that is lit evenly but for a fall-off towards one side."""

    bits: int = 12
    well: float = 30_000.0
    read: float = 8.0
    dark_per_s: float = 20.0
    black_dn: float = 64.0
    curve: Callable[[Array], Array] = proportional
    shape: tuple[int, int] = (50, 60)
    flicker: float = 0.0
    shading: float = 0.05
    full_s: float = 0.05  # exposure that fills the well
    random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    factors: Array | float = 1.0
    darks: Array | float = 0.0
    hot_per_s: Array | float = 0.0

    @property
    def max_dn(self) -> int:
        return 2**self.bits - 1

    @property
    def gain(self) -> float:
        """DN per electron at full scale."""
        return (self.max_dn - self.black_dn) / self.well

    def frame(self, exposure_s: float, *, lit: bool) -> Array:
        fall = 1 - self.shading * np.linspace(0, 1, self.shape[1]) ** 2
        level = 1 + self.flicker * self.random.standard_normal() if lit else 0.0
        light = self.well * exposure_s / self.full_s * level * fall * self.factors
        thermal = (self.dark_per_s + self.hot_per_s) * exposure_s
        mean = np.broadcast_to(light + thermal, self.shape)
        electrons = np.minimum(self.random.poisson(mean), self.well)
        electrons = electrons + self.read * self.random.standard_normal(self.shape) + self.darks
        share = self.curve(electrons / self.well)
        counts = np.rint(self.black_dn + share * (self.max_dn - self.black_dn))
        return np.clip(counts, 0, self.max_dn)

    def stack(self, exposure_s: float, frames: int, *, lit: bool) -> Array:
        return np.stack([self.frame(exposure_s, lit=lit) for _ in range(frames)])

    def levels(self, count: int = 24, frames: int = 2) -> tuple[LevelSeries, LevelSeries]:
        """Lit levels to 1.25 of the well, and darks also at 1 and 2 s."""
        exposures = np.linspace(0.02, 1.25, count) * self.full_s
        dark = np.unique(np.concatenate([exposures, [1.0, 2.0]]))
        order = self.random.permutation(count)
        return (
            level_series(exposures, [self.stack(e, frames, lit=True) for e in exposures], order),
            level_series(dark, [self.stack(e, frames, lit=False) for e in dark]),
        )


def level_series(exposure_s: Array, stacks: list[Array], age_s: Array | None = None) -> LevelSeries:
    """Levels of stacks (frames, rows, columns)."""
    means = [stack.mean(axis=(1, 2)) for stack in stacks]
    own = [s - m[:, None, None] for s, m in zip(stacks, means, strict=True)]
    return LevelSeries(
        exposure_s=np.asarray(exposure_s, dtype=np.float64),
        mean_dn=np.array([m.mean() for m in means]),
        variance_dn2=np.array([o.var(axis=0, ddof=1).mean() for o in own]),
        scatter_dn2=np.array([m.var(ddof=1) for m in means]),
        frames=np.array([float(len(m)) for m in means]),
        age_s=np.zeros(len(means)) if age_s is None else np.asarray(age_s, dtype=np.float64),
        pixels=stacks[0][0].size,
    )
