"""Stray light in the window of each reading, from the dark patch in all frames of a run.

The lens is the same in all readings: the shares of light that it scatters near by, farther and
far, and the reflectance of the patch, are four unknowns for all of them. Each reading tells the
level of the patch, and as the camera swings the sample narrows, so that the readings tell the
shares apart as far as it matters. It is a linear problem with a prior (Gauss-Markov): before the
readings each Gaussian may give the patch a third of its light, with as large an uncertainty. What
is left unknown is an error that all readings share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.measure.stray_light import white_dn
from instrument.config.rig import Rig
from instrument.geometry import FloatArray
from instrument.record.reading import Reading

_U_WHITE = 0.2  # relative, of the rig file's white_electrons_per_s, which only predicts (assumed)
_U_MODEL = (
    0.05  # relative, of the patch: a real point spread is no sum of three Gaussians (assumed)
)
_LEAST_SHARE = 1e-4  # scattered, that cannot be excluded beforehand
_SHARES = ("near", "middle", "far")
_LEVEL = ("patch_dn", "u_patch_dn")


@dataclass(frozen=True, slots=True)
class StrayLight:
    """Stray light in the window of N readings: `dn` (N,) and its independent errors (M, N), in DN.

    steps: number of each reading among them, by its step in the plan.
    """

    steps: dict[int, int]
    dn: FloatArray
    errors_dn: FloatArray

    def subtracted(self, readings: Sequence[Reading]) -> list[Reading]:
        """Return the readings without stray light in their signal; drift checks as they are.

        Of these only ratios count, with those at a resume too, and their share of it is the same.
        """
        return [r if r.kind == "drift" else self._subtracted(r) for r in readings]

    def _subtracted(self, reading: Reading) -> Reading:
        stray_dn = float(self.dn[self.steps[reading.step]])
        return replace(reading, signal_dn=reading.signal_dn - stray_dn)

    def errors_of(self, readings: Sequence[Reading]) -> FloatArray:
        """Return the errors (M, readings) of these readings, signed and in DN."""
        return self.errors_dn[:, [self.steps[r.step] for r in readings]]


def stray_light(readings: Sequence[Reading], rig: Rig) -> StrayLight | None:
    """Return the stray light in all readings; None where the rig has no dark patch, or no picture.

    A reading that does not show the patch is flagged, and taken to have none. Flagged readings say
    nothing of the lens.
    """
    patch = rig.camera.dark_patch
    if patch is None or not any(r.far_patch_dn for r in readings):
        return None
    into_window, into_patch = (
        np.array([[getattr(r, f"{share}_{where}_dn") for share in _SHARES] for r in readings])
        for where in ("window", "patch")
    )
    level, u_level = (np.array([getattr(r, name) for r in readings]) for name in _LEVEL)
    white = np.array([white_dn(rig, r.theta_i_deg, r.exposure_s) for r in readings])
    clean = np.array([not r.flags and r.u_patch_dn > 0 for r in readings], dtype=bool)
    light = np.maximum(level - patch.reflectance * white, 0.0)[clean].sum()
    share = light / np.maximum(into_patch[clean].sum(axis=0), 1e-9) / len(_SHARES) + _LEAST_SHARE
    u_own = float(np.hypot(patch.u_reflectance, _U_WHITE * patch.reflectance))
    found, covariance = _estimate(
        response=np.column_stack([into_patch, white])[clean],
        level=level[clean],
        u=np.hypot(u_level, _U_MODEL * np.abs(level))[clean],
        prior=np.array([*share, patch.reflectance]),
        u_prior=np.array([*share, max(u_own, 1e-9)]),
    )
    modes = np.linalg.cholesky(covariance)[: len(_SHARES)].T
    steps = {r.step: n for n, r in enumerate(readings)}
    return StrayLight(steps, into_window @ found[: len(_SHARES)], modes @ into_window.T)


def _estimate(
    *,
    response: FloatArray,
    level: FloatArray,
    u: FloatArray,
    prior: FloatArray,
    u_prior: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return unknowns (K,) and their covariance (K, K) from levels (N,) = response (N, K) @ them.

    level, response and u of the levels, (N,), in DN. prior, u_prior: (K,), dimensionless.
    """
    rows = response * u_prior / u[:, np.newaxis]
    left = (level - response @ prior) / u
    covariance = np.linalg.inv(rows.T @ rows + np.eye(prior.size))
    return prior + u_prior * (covariance @ rows.T @ left), covariance * np.outer(u_prior, u_prior)
