"""Foreign check: frames of the camera simulator of the package `emva1288`, and its evaluation.

The package is the reference implementation of the standard (version 1.0.2, for release 4.0). Both
evaluate the same frames: two of each exposure, lit and dark, light to a little above saturation.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from analysis.calibration.camera_fit import fit_camera
from analysis.calibration.pixel_maps import Stack, dsnu, prnu
from tests.support.calibration.sensor_model import Array, level_series

MISSING = "the package emva1288 is not installed: no foreign check of the camera's evaluation"
camera = pytest.importorskip("emva1288.camera.camera", reason=MISSING)
quantum = pytest.importorskip("emva1288.camera.routines", reason=MISSING)
routines = pytest.importorskip("emva1288.process.routines", reason=MISSING)
data = pytest.importorskip("emva1288.process.data", reason=MISSING)
results = pytest.importorskip("emva1288.process.results", reason=MISSING)

WIDTH, HEIGHT, LEVELS, STACK = 110, 90, 22, 10
CASES: dict[int, dict[str, float]] = {
    8: {"K": 0.02, "blackoffset": 8, "sigma2_dark_0": 900.0},
    10: {"K": 0.05, "blackoffset": 20, "sigma2_dark_0": 300.0},
    12: {"K": 0.12, "blackoffset": 40, "sigma2_dark_0": 100.0},
}


@pytest.fixture(autouse=True)
def old_numpy(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package of 2023 calls a function that NumPy 2 no longer has, and logs a lot."""
    monkeypatch.setattr(np, "asfarray", lambda a: np.asarray(a, dtype=float), raising=False)
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


class Bench:
    """The package's camera before an even light, with its frames by exposure in ns."""

    def __init__(self, bits: int) -> None:
        own = CASES[bits]
        random = np.random.default_rng(bits)
        efficiency = quantum.Qe(
            qe=np.full((HEIGHT, WIDTH, 1), 0.5), wavelength=np.array([550.0]),
            width=WIDTH, height=HEIGHT,
        )  # fmt: skip
        self.camera = camera.Camera(
            bit_depth=bits, width=WIDTH, height=HEIGHT, qe=efficiency, seed=bits,
            exposure_min=1e6, exposure_max=5e7, K_min=own["K"], K_max=own["K"], K_steps=1,
            blackoffset_max=2**bits, blackoffset_steps=2**bits + 1, u_esat=1e6,
            dark_current_ref=300.0, dark_signal_0=150.0,
            prnu=1 + 0.008 * random.standard_normal((HEIGHT, WIDTH)),
            dsnu=12.0 * random.standard_normal((HEIGHT, WIDTH)), **own,
        )  # fmt: skip
        self.exposures_ns = np.round(np.linspace(1e6, 5e7, LEVELS), 1)
        self.camera.exposure = 5e7
        self.light = self.camera.get_radiance_for() * 1.08
        self.lit = [self.taken(e, self.light, 2) for e in self.exposures_ns]
        self.dark = [self.taken(e, 0 * self.light, 2) for e in self.exposures_ns]
        middle = self.exposures_ns[LEVELS // 2]
        self.flat, self.flat_dark = (
            self.taken(middle, light, STACK) for light in (self.light, 0 * self.light)
        )

    def taken(self, exposure_ns: float, light: Array, count: int) -> Array:
        self.camera.exposure = exposure_ns
        return np.stack([self.camera.grab(light) for _ in range(count)]).astype(float)

    def photons(self, exposure_ns: float) -> float:
        self.camera.exposure = exposure_ns
        return float(self.camera.get_photons(self.light).sum(axis=2).mean())

    def evaluated(self) -> Any:
        """The package's results, from its own sums of the frames."""
        temporal = {}
        for exposure, lit, dark in zip(self.exposures_ns, self.lit, self.dark, strict=True):
            sums = {0.0: dark, self.photons(exposure): lit}
            temporal[exposure] = {p: _totals(frames) for p, frames in sums.items()}
        middle = self.exposures_ns[LEVELS // 2]
        spatial = {
            p: routines.get_int_imgs(list(frames))
            for p, frames in ((0.0, self.flat_dark), (self.photons(middle), self.flat))
        }
        own = {"width": WIDTH, "height": HEIGHT, "temporal": temporal, "spatial": {middle: spatial}}
        return results.Results1288(data.Data1288(own).data)


def _totals(frames: Array) -> dict[str, float]:
    sums = routines.get_int_imgs(list(frames))
    return {"sum": sums["sum"].sum(), "pvar": sums["pvar"].sum(), "dmean": sums["dmean"]}


def _stack(frames: Array) -> Stack:
    return Stack(
        exposure_s=0.025, mean_dn=frames.mean(axis=0), variance_dn2=frames.var(axis=0, ddof=1),
        frames=len(frames),
    )  # fmt: skip


@pytest.mark.parametrize("bits", sorted(CASES))
def test_its_evaluation_of_its_frames_agrees_within_1_percent(bits: int) -> None:
    bench = Bench(bits)
    theirs = bench.evaluated()
    exposures_s = bench.exposures_ns * 1e-9
    lit, dark = (level_series(exposures_s, stacks) for stacks in (bench.lit, bench.dark))
    ours = fit_camera(lit, dark, bench.camera.img_max)
    transfer, gain = ours.transfer, ours.transfer.gain_dn_per_electron
    assert transfer.dark_noise_electrons is not None
    assert transfer.saturation_electrons is not None
    assert transfer.dark_current_electrons_per_s is not None
    assert gain.value == pytest.approx(theirs.K, rel=0.01)
    assert gain.value == pytest.approx(bench.camera.K, abs=4 * gain.u)
    assert transfer.dark_noise_electrons.value == pytest.approx(theirs.sigma_d, rel=0.01)
    assert transfer.saturation_electrons.value == pytest.approx(theirs.u_e_sat, rel=0.01)
    assert ours.linearity.least_percent == pytest.approx(theirs.LE_min, rel=0.01)
    assert ours.linearity.most_percent == pytest.approx(theirs.LE_max, rel=0.01)
    assert transfer.dark_current_electrons_per_s.value == pytest.approx(theirs.u_I_mean, rel=0.01)
    everywhere = np.ones((HEIGHT, WIDTH), dtype=bool)
    flat, base = _stack(bench.flat), _stack(bench.flat_dark)
    response, offset = prnu(flat, base, everywhere), dsnu(base, everywhere, gain.value)
    # Ours is high-passed, theirs is not: both estimate the same pixels with different weights.
    assert 100 * response.value == pytest.approx(theirs.PRNU1288, rel=0.02)
    assert offset.value == pytest.approx(theirs.DSNU1288, rel=0.02)
