"""Worth of each correction: the error of the BRDF with all of them, and without each in turn.

The same benches, each with defects of its own, are measured with every set of corrections. The
truth is the sample's BRDF at the geometry that was asked for, averaged over lamp and lens.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from acquisition.benchmark.corrections.real_bench import Corrections, real_bench
from acquisition.benchmark.demo_scan import reduced_scan, sample_of
from analysis.data.acceptance import Acceptance, averaged_brdf
from analysis.models import MODELS
from instrument.config.load import Loaded
from instrument.geometry import BoolArray, FloatArray, Geometry

BANDS_DEG = ((0.0, 60.0), (60.0, 75.0), (75.0, 85.0))
"""Ranges of |theta_r| that are told apart."""
ALL = Corrections()
WITHOUT: dict[str, Corrections] = {
    "table of the white tile": Corrections(tile_table=False),
    "drift checks": Corrections(drift_checks=False),
    "ageing of the tile": Corrections(lines={"tile_aged": 0.0}),
    "stray light of the lens": Corrections(lines={"stray_light": 0.0}),
    "response of the camera": Corrections(response=False),
    "light from the walls": Corrections(lines={"wall_light": 0.0}),
    "vignetting": Corrections(lines={"vignetting": 0.0}),
}
"""Corrections that `ALL` has, by name, and what is left without each."""
WITH: dict[str, Corrections] = {
    "dark patch for stray light": Corrections(dark_patch=True),
    "zero of theta_r calibrated": Corrections(zero=True),
}
"""Corrections beyond `ALL`, by name."""
_RINGS = 4  # of the truth's average over lamp and lens


@dataclass(frozen=True, slots=True)
class Worth:
    """Relative errors of all points, over all benches, with one set of corrections.

    theta_r_deg, error: (N,), the same points for every set; NaN for a point that is flagged.
    """

    theta_r_deg: FloatArray
    error: FloatArray

    def rms(self, band_deg: tuple[float, float]) -> float:
        """Root mean square of the errors in a band of |theta_r|."""
        return _rms(self.error[self._within(band_deg)])

    def bias(self, band_deg: tuple[float, float]) -> float:
        """Mean of the errors in a band of |theta_r|."""
        return float(np.nanmean(self.error[self._within(band_deg)]))

    def change(self, other: Worth, band_deg: tuple[float, float]) -> float:
        """Root mean square of the difference between the values of two sets of corrections."""
        return _rms((self.error - other.error)[self._within(band_deg)])

    def _within(self, band_deg: tuple[float, float]) -> BoolArray:
        size = np.abs(self.theta_r_deg)
        return np.asarray((size >= band_deg[0]) & (size < band_deg[1]))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def worth(corrections: Corrections, benches: int) -> Worth:
    """Measure on so many benches."""
    with TemporaryDirectory(prefix="gonio-bench-") as folder:
        scans = (real_bench(seed, corrections) for seed in range(benches))
        found = list(_errors(scans, Path(folder)))
    return Worth(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _errors(scans: Iterator[Loaded], folder: Path) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the view angles and relative errors of the points of each scan."""
    for number, loaded in enumerate(scans):
        reduced = reduced_scan(loaded, folder / str(number))
        theta_i, theta_r, dphi = np.array(
            [(p.theta_i_deg, p.theta_r_deg, p.dphi_deg) for p in reduced.points]
        ).T
        error = reduced.brdf / _truth(loaded, (theta_i, theta_r, dphi)) - 1
        yield theta_r, np.where(reduced.valid, error, np.nan)


def _truth(loaded: Loaded, angles_deg: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
    """True BRDF of the sample at angles (N,) each, in 1/sr."""
    sample = sample_of(loaded)
    model, parameters = MODELS[sample.model], sample.parameters

    def brdf(geometry: Geometry) -> FloatArray:
        return model.brdf(geometry, **parameters)

    acceptance = Acceptance.of(loaded.rig, loaded.protocol.window)
    return averaged_brdf(brdf, *angles_deg, acceptance, _RINGS)
