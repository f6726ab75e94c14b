"""From reduced readings to the choice of a model: what the fit sees, and what it says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.results.reduction import Reduced, root_sum_square
from analysis.choice.choice import Choice, choose
from analysis.data.acceptance import Acceptance
from analysis.data.measurements import Measurements
from analysis.fit.fit import FitResult, stated_u
from instrument.config.load import Loaded
from instrument.errors import NotDetermined
from instrument.geometry import BoolArray, FloatArray


@dataclass(frozen=True, slots=True)
class Fitted:
    """The choice, or None and the reason why there is none; `used` marks the fitted points (N,)."""

    choice: Choice | None
    used: BoolArray
    reason: str

    @property
    def chosen(self) -> FitResult | None:
        """The chosen candidate."""
        if self.choice is None or self.choice.chosen is None:
            return None
        return next(c for c in self.choice.candidates if c.model == self.choice.chosen)

    def u_brdf(self, reduced: Reduced) -> FloatArray:
        """Standard uncertainty of every BRDF (N,), 1/sr: with the angles' share where fitted."""
        u = np.abs(reduced.brdf) * root_sum_square(list(reduced.parts.values()))
        if self.chosen is not None and reduced.has_brdf:
            u[self.used] = self.chosen.u_total
        return u


def fit_run(reduced: Reduced, loaded: Loaded) -> Fitted:
    """Fit the sound points; what keeps a fit from being made is said, not raised."""
    acceptance = Acceptance.of(loaded.rig, loaded.protocol.window)
    asked = loaded.protocol.fit
    try:
        choice = choose(
            measurements(reduced, loaded), acceptance, asked.models, method=asked.method
        )
    except (NotDetermined, ValueError) as error:  # too few points, or none that shows light
        return Fitted(None, reduced.sound, str(error))
    return Fitted(choice, reduced.sound, choice.reason)


def cost_of(
    names: Sequence[str], reduced: Reduced, chosen: FitResult, loaded: Loaded
) -> dict[str, tuple[float, float]]:
    """u of each determined parameter of the chosen model with, and without, some parts of u."""
    with_them = stated_u(chosen, measurements(reduced, loaded))
    without = stated_u(chosen, measurements(reduced, loaded, without=names))
    return {name: (with_them[name], without[name]) for name in with_them}


def measurements(reduced: Reduced, loaded: Loaded, without: Sequence[str] = ()) -> Measurements:
    """The sound points as the fit sees them, `without` some parts of their uncertainty.

    Without a white tile they are relative: radiance over cos(theta_i), which goes as the BRDF at
    one setting of the lamp; how bright the lamp is at each setting is not known.
    """
    keep = reduced.sound
    points = [p for p, kept in zip(reduced.points, keep, strict=True) if kept]
    own = [u[keep] for name, u in reduced.components.items() if name not in without]
    theta_i_deg, axes = np.array([p.theta_i_deg for p in points]), loaded.rig.axes
    shared = (*reduced.shared, *reduced.shared_by_tile)
    brdf = reduced.brdf if reduced.has_brdf else reduced.radiance
    brdf = brdf[keep] if reduced.has_brdf else brdf[keep] / np.cos(np.radians(theta_i_deg))
    return Measurements(
        theta_i_deg=theta_i_deg,
        theta_r_deg=np.array([p.theta_r_deg for p in points]),
        dphi_deg=np.array([p.dphi_deg for p in points]),
        brdf=brdf,
        u_random=root_sum_square(own) * np.abs(brdf),
        lamp_setting=np.array([p.lamp_setting for p in points], dtype=np.int64),
        shared=tuple(e.subset(keep) for e in shared if e.name not in without),
        u_theta_i_deg=axes.theta_i.u_deg,
        u_theta_r_deg=axes.theta_r.u_deg,
        u_dphi_deg=axes.dphi.u_deg,
        relative=not reduced.has_brdf,
        free_levels=not reduced.has_brdf,
    )
