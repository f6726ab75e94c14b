"""Fit of a rig's geometry to the corners of a board, with uncertainties from the residuals.

Beside the shared parameters everything that repeats imperfectly has deviations of its own: view
angles, places and bends of pictures, corners of the print. How large they are is estimated from the
data, by expectation and maximisation; so is the noise of the corners in each picture. The board is
seen in two places, with half a turn between them: a lean of the board changes its sign by that,
and the zero of the axis does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.calibration.geometry.corners import Corners
from analysis.calibration.geometry.parameters import NAMES, Model
from analysis.calibration.geometry.projection import Lens
from analysis.calibration.level_series import Estimate
from instrument.errors import NotDetermined
from instrument.geometry import BoolArray, FloatArray
from instrument.pinhole import Pinhole

_CENTRE_SHARE = 0.02  # of the width: standard deviation of a lens's axis from the picture's middle
_SAG_PX = 1.0  # standard deviation of the beam's sag, in the picture (assumed)
_FIRST_PX = 0.05  # of a corner, before it is known: that of OpenCV's refinement, about
_FIRST = {"columns": 0.05, "rows": 0.05, "bends": 0.03, "print": 0.005}
"""Standard deviations of the groups before they are known: small ones, which grow at once if they
must, while large ones shrink slowly."""
_LEAST = {"axis": 1e-3, "columns": 2e-3, "rows": 2e-3, "bends": 0.02, "print": 2e-3}
"""Least ones. Blur, light and the phase of pixels move corners alike in all pictures, which no
scatter shows: by as much on the simulated bench with all its defects."""
_LEAST_PX = 2e-3  # of a corner: keeps weights finite
_OUTLIER = 8.0  # robust standard deviations
_ROUNDS = 4  # of expectation and maximisation
_STEPS, _CLOSE = 40, 0.1  # of Gauss and Newton, and the last one in units of u
_HALVES = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class GeometryFit:
    """Fitted geometry: each of `NAMES` with u, the camera, and what the fit leaves.

    residuals_px (n, 2): of the corners that were used, (n,) True. spread: standard deviations of
    the groups of `Model`.
    """

    values: dict[str, Estimate]
    lens: Lens
    residuals_px: FloatArray
    used: BoolArray
    spread: dict[str, float]

    @property
    def rms_px(self) -> float:
        """Root mean square of the distance between a corner and its prediction, in pixels."""
        return float(np.sqrt(np.mean(np.sum(self.residuals_px**2, axis=1))))


@dataclass(frozen=True, slots=True)
class _Solved:
    """Parameters of the least squares, their covariance, and measured minus predicted pixels."""

    vector: FloatArray
    covariance: FloatArray
    residuals_px: FloatArray


def fit_geometry(corners: Corners, start: Pinhole, u_axis_deg: float) -> GeometryFit:
    """Return the fit. `start`: the camera by the rig file; `u_axis_deg`: of theta_r by it.

    Raises `NotDetermined` if corners and board do not come together.
    """
    u_axis_deg = max(u_axis_deg, _LEAST["axis"])
    spread, noise_px = {"axis": u_axis_deg, **_FIRST}, np.full(corners.pictures, _FIRST_PX)
    model = Model(corners, start)
    rough = _solved(model, model.first(), spread, noise_px)
    used = _plausible(rough.residuals_px, corners)
    model, found = Model(corners.only(used), start), rough
    for _ in range(_ROUNDS):
        found = _solved(model, found.vector, spread, noise_px)
        noise_px = _found_noise(model, found, spread)
        spread = _found_spread(model, found, u_axis_deg)
    found = _solved(model, found.vector, spread, noise_px)
    u = np.sqrt(np.diag(found.covariance))
    return GeometryFit(
        values={n: Estimate(float(found.vector[k]), float(u[k])) for k, n in enumerate(NAMES)},
        lens=model.lens(found.vector),
        residuals_px=found.residuals_px,
        used=used,
        spread=spread,
    )


def _solved(
    model: Model, vector: FloatArray, spread: dict[str, float], noise_px: FloatArray
) -> _Solved:
    """Return the least squares from a vector on; noise_px (pictures,) is that of corners."""
    weight = 1 / noise_px[model.corners.picture][:, np.newaxis]
    prior = _prior(model, spread)

    def weighted(vector: FloatArray) -> FloatArray:
        return np.asarray((model.corners.pixels - model.pixels(vector)) * weight).ravel()

    def cost(vector: FloatArray) -> float:
        return float(np.sum(weighted(vector) ** 2) + np.sum(prior * vector**2))

    for _ in range(_STEPS):
        flat = (model.jacobian(vector) * weight[:, :, np.newaxis]).reshape(-1, model.size)
        normal = flat.T @ flat + np.diag(prior)
        towards = flat.T @ weighted(vector) - prior * vector
        step: FloatArray = np.linalg.solve(normal, towards).astype(np.float64)
        if not np.all(np.isfinite(step)):
            break
        gain = float(step @ towards)
        vector = vector + _shortened(step, vector, cost)
        if gain < _CLOSE**2:
            residuals = model.corners.pixels - model.pixels(vector)
            return _Solved(vector, np.linalg.inv(normal).astype(np.float64), residuals)
    raise NotDetermined(
        "board: its corners fit no position of camera and board. Compare --columns, --rows and "
        "--square-mm with the board, and look whether it was moved"
    )


def _shortened(
    step: FloatArray, vector: FloatArray, cost: Callable[[FloatArray], float]
) -> FloatArray:
    """Return the step, halved until it lowers the cost: distortion and its middle are a product."""
    here = cost(vector)
    for _ in range(_HALVES):
        if cost(vector + step) < here:
            break
        step = step / 2
    return step


def _prior(model: Model, spread: dict[str, float]) -> FloatArray:
    """Return the weight of each parameter's prior (parameters,); 0 without one. Its value is 0."""
    prior = np.zeros(model.size)
    centre_px = _CENTRE_SHARE * model.start.width_px
    for name, known in (
        ("centre_column_px", centre_px),
        ("centre_row_px", centre_px),
        ("sag_px", _SAG_PX),
        ("row_sag_px", _SAG_PX),
    ):
        prior[NAMES.index(name)] = known**-2
    for name, own in model.groups.items():
        prior[own] = spread[name] ** -2
    return prior


def _plausible(residuals_px: FloatArray, corners: Corners) -> BoolArray:
    """Return True (n,) for the corners that lie where the others let expect them."""
    distance = np.hypot(*residuals_px.T)
    usual = np.array(
        [np.median(distance[corners.picture == number]) for number in range(corners.pictures)]
    )
    # The median distance of normal errors is 1.18 standard deviations.
    return np.asarray(distance <= _OUTLIER * np.maximum(usual[corners.picture] / 1.18, _LEAST_PX))


def _found_noise(model: Model, found: _Solved, spread: dict[str, float]) -> FloatArray:
    """Return the noise of corners in each picture (pictures,) in pixels, as the residuals show."""
    own, squares = model.corners, np.sum(found.residuals_px**2, axis=1)
    numbers = np.bincount(own.picture, minlength=own.pictures)
    sums = np.bincount(own.picture, squares, minlength=own.pictures)
    # A parameter that its prior holds takes no degree of freedom.
    held = float(np.sum(np.diag(found.covariance) * _prior(model, spread)))
    left = 1 - (model.size - held) / found.residuals_px.size
    return np.maximum(np.sqrt(sums / (2 * numbers * max(left, 0.1))), _LEAST_PX)


def _found_spread(model: Model, found: _Solved, u_axis_deg: float) -> dict[str, float]:
    """Return the standard deviation of each group: of its values, with their own variance."""
    variance = np.diag(found.covariance)
    spread = {}
    for name, own in model.groups.items():
        mean2 = float(np.mean(found.vector[own] ** 2 + variance[own]))
        spread[name] = max(float(np.sqrt(mean2)), _LEAST[name])
    spread["axis"] = max(spread["axis"], u_axis_deg)
    return spread
