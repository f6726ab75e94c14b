"""Fit of a run: from reduced readings to measurements, and to the choice of a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from acquisition.results.effects.turning import BLUR
from acquisition.results.reduction import Reduced, require_usable, root_sum_square, shared_errors
from analysis.choice.choice import Choice, choose
from analysis.choice.fit_json import no_fit_json, to_json
from analysis.data.acceptance import Acceptance
from analysis.data.covariance import ANGLES, contributions
from analysis.data.measurements import Measurements
from analysis.fit.fit import FitResult, stated_u
from instrument.config.load import Loaded
from instrument.errors import NotDetermined
from instrument.geometry import BoolArray, FloatArray


@dataclass(frozen=True, slots=True)
class Fitted:
    """Choice of a model for a run of N points, or None and the reason for it.

    used: mask (N,) of the points that were fitted. measurements: those points as the fit had them,
    None where there is no choice. failure: the error for which there is none, if a fit raised one.
    """

    choice: Choice | None
    used: BoolArray
    reason: str
    measurements: Measurements | None = None
    failure: NotDetermined | None = None

    @property
    def chosen(self) -> FitResult | None:
        """The chosen candidate, None if there is none."""
        if self.choice is None or self.choice.chosen is None:
            return None
        return next(c for c in self.choice.candidates if c.model == self.choice.chosen)

    def as_json(self) -> dict[str, Any]:
        """Content of fit.json."""
        if self.choice is not None:
            return to_json(self.choice)
        return no_fit_json(self.failure or NotDetermined(self.reason))

    def parts(self, reduced: Reduced) -> dict[str, FloatArray]:
        """Standard uncertainties of the BRDF by name, (N,) and relative.

        For fitted points with the part that needs a model: how angles change the value. For the
        others that is not known, NaN for the angles' setting.
        """
        parts, m = reduced.parts, self.measurements
        if self.chosen is None or m is None or not reduced.has_brdf:
            return parts
        parts[ANGLES] = np.full(len(reduced.points), np.nan)
        for name, u in contributions(m, self.chosen.brdf).items():
            parts[name] = parts[name].copy()
            parts[name][self.used] = u / np.abs(m.brdf)
        return parts

    def u_brdf(self, reduced: Reduced) -> FloatArray:
        """Standard uncertainty of every BRDF, (N,) in 1/sr.

        That of fitted points includes the part from the angles, which needs a model. A model is
        averaged over the turn of a moving axis, the value is not: its blur is part of its u.
        """
        u = np.abs(reduced.brdf) * root_sum_square(list(reduced.parts.values()))
        if self.chosen is not None and reduced.has_brdf:
            u[self.used] = self.chosen.u_total
            if BLUR in reduced.components:
                blurred = np.abs(reduced.brdf) * reduced.components[BLUR]
                u[self.used] = np.hypot(u, blurred)[self.used]
        return u


def fit_run(reduced: Reduced, loaded: Loaded) -> Fitted:
    """Fit the valid points; where no fit is possible, return the reason."""
    acceptance = Acceptance.of(loaded.rig, loaded.protocol.window)
    asked = loaded.protocol.fit
    try:
        require_usable(reduced)
        fitted = measurements(reduced, loaded)
        choice = choose(
            fitted,
            acceptance,
            asked.models,
            method=asked.method,
            certificate_leads=asked.certificate_leads,
        )
    except NotDetermined as error:
        return Fitted(None, reduced.valid, str(error), failure=error)
    except ValueError as error:  # values outside their domain, such as a u of 0
        return Fitted(None, reduced.valid, str(error))
    return Fitted(choice, reduced.valid, choice.reason, fitted)


def u_without(
    components: Sequence[str], fitted: Fitted, reduced: Reduced
) -> dict[str, tuple[float, float]]:
    """Standard uncertainty of each determined parameter with and without `components` of u.

    In the parameters' units, from the stated uncertainties alone, for the chosen model.
    """
    chosen, m = fitted.chosen, fitted.measurements
    if chosen is None or m is None:
        return {}
    fewer = replace(
        m,
        u_random=reduced.u_independent(components)[fitted.used] * np.abs(m.brdf),
        shared=tuple(error for error in m.shared if error.name not in components),
    )
    stated, without = stated_u(chosen, m), stated_u(chosen, fewer)
    return {name: (stated[name], without[name]) for name in stated}


def measurements(reduced: Reduced, loaded: Loaded) -> Measurements:
    """Return the valid points as the fit takes them.

    Without a white tile they are relative: radiance over cos(theta_i) is proportional to the BRDF
    at one lamp setting, and the lamp's level at each setting is unknown.
    """
    keep = reduced.valid
    points = [p for p, kept in zip(reduced.points, keep, strict=True) if kept]
    theta_i_deg, axes = np.array([p.theta_i_deg for p in points]), loaded.rig.axes
    brdf = reduced.brdf if reduced.has_brdf else reduced.radiance
    blur_deg = np.array([p.blur_deg for p in points])
    brdf = brdf[keep] if reduced.has_brdf else brdf[keep] / np.cos(np.radians(theta_i_deg))
    return Measurements(
        theta_i_deg=theta_i_deg,
        theta_r_deg=np.array([p.theta_r_deg for p in points]),
        dphi_deg=np.array([p.dphi_deg for p in points]),
        brdf=brdf,
        u_random=reduced.u_independent()[keep] * np.abs(brdf),
        lamp_setting=np.array([p.lamp_setting for p in points], dtype=np.int64),
        shared=tuple(e.subset(keep) for e in shared_errors(reduced, loaded.rig)),
        u_theta_i_deg=axes.theta_i.u_deg,
        u_theta_r_deg=axes.theta_r.u_deg,
        u_dphi_deg=axes.dphi.u_deg,
        blur_deg=blur_deg if np.any(blur_deg) else 0.0,
        relative=not reduced.has_brdf,
        free_levels=not reduced.has_brdf,
    )
