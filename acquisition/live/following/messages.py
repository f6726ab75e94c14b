"""Messages about a run: its description, its points, its events.

Numbers are rounded to what can be seen: a lamp whose drift is known a little better does not send
every point again.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator
from typing import Any

import numpy as np

from acquisition.live.following.curves import Curves
from acquisition.plan.plan import Plan
from acquisition.results.reduction import NO_TILE_YET, Reduced, root_sum_square
from instrument.config.load import Loaded
from instrument.geometry import FloatArray
from instrument.record.reading import Reading, Rows
from instrument.text.terminal_safe import escape_control_characters

Content = dict[str, Any]
_DIGITS = 6  # of a number without u
_DIGITS_OF_U = 3


def run_content(
    loaded: Loaded, plan: Plan, curves: Curves, folder: str, started_utc: str
) -> Content:
    """Return the description of a run."""
    protocol, absolute = loaded.protocol, is_absolute(loaded)
    return {
        "title": protocol.name,
        "sample": protocol.sample.name,
        "folder": escape_control_characters(folder),
        "rig": loaded.rig.name,
        "quantity": "BRDF" if absolute else "radiance",
        "unit": "1/sr" if absolute else "counts/s",
        "steps": len(plan.known),
        "points": sum(step.kind == "point" for step in plan.known),
        "started_utc": started_utc,
        "sweep": curves.sweep,
        "range_deg": list(curves.range_deg),
        "aiming": False,
    }


def is_absolute(loaded: Loaded) -> bool:
    """Return True where a white tile gives the BRDF; else the radiance is relative."""
    return loaded.protocol.references.white_tile is not None


class PointMessages:
    """Messages about the readings of a run; `with_frame`: steps of which a picture is kept."""

    def __init__(self, loaded: Loaded, curves: Curves, with_frame: Container[int]) -> None:
        self._curves, self._with_frame = curves, with_frame
        self._full_scale_dn = loaded.rig.camera.max_dn
        self._absolute = is_absolute(loaded)

    def of(self, rows: Rows, reduced: Reduced) -> Iterator[tuple[int, Content]]:
        """Yield step and content of every reading, in the order of the plan."""
        values, u = self._values(reduced)
        own = {
            point.step: (*_rounded(float(v), float(u_v)), flags.split("; "))
            for point, v, u_v, flags in zip(reduced.points, values, u, reduced.flags, strict=True)
        }
        for reading in rows.readings:
            alone = (None, None, reading.flags.split("; "))
            value, u_value, flags = own.get(reading.step, alone)
            yield (
                reading.step,
                self._counts(reading)
                | {
                    "value": value,
                    "u": u_value,
                    "flags": [flag for flag in flags if flag and flag != NO_TILE_YET],
                    "provisional": NO_TILE_YET in flags,
                },
            )

    def _values(self, reduced: Reduced) -> tuple[FloatArray, FloatArray]:
        """Values (N,) in the run's unit and their u, without the part that needs a model."""
        if not self._absolute:
            return reduced.radiance, reduced.u_radiance
        u = np.abs(reduced.brdf) * root_sum_square(list(reduced.parts.values()))
        brdf, u_brdf = _provisional_brdf(reduced)
        unknown = np.isnan(reduced.brdf)
        return np.where(unknown, brdf, reduced.brdf), np.where(unknown, u_brdf, u)

    def _counts(self, reading: Reading) -> Content:
        return {
            "step": reading.step,
            "kind": reading.kind,
            "theta_i_deg": reading.theta_i_deg,
            "theta_r_deg": reading.theta_r_deg,
            "dphi_deg": reading.dphi_deg,
            "curve": self._curves.name_of(reading),
            "x_deg": self._curves.x_deg(reading),
            "signal_dn": rounded(reading.signal_dn),
            "peak_dn": rounded(reading.peak_dn),
            "full_scale_dn": self._full_scale_dn,
            "saturated_pixels": reading.saturated_pixels,
            "exposure_s": rounded(reading.exposure_s),
            "frames": reading.frames,
            "window_pixels": rounded(reading.window_pixels),
            "time_utc": reading.time_utc,
            "has_frame": reading.step in self._with_frame,
        }


def _provisional_brdf(reduced: Reduced) -> tuple[FloatArray, FloatArray]:
    """BRDF (N,) in 1/sr and its u as if the lamp were as bright as at the tiles that were read.

    Where the lamp is set by hand, the tile of a setting may follow after all of its points.
    """
    lit = reduced.radiance / np.cos(np.radians([p.theta_i_deg for p in reduced.points]))
    per_brdf = (lit / reduced.brdf)[reduced.valid & np.isfinite(reduced.brdf)]
    level = float(np.median(per_brdf)) if per_brdf.size else math.nan
    u_relative = reduced.u_radiance / np.abs(reduced.radiance)
    return lit / level, np.abs(lit / level) * u_relative


def event_contents(rows: Rows) -> Iterator[Content]:
    """Yield the content of every event."""
    for number, (time_utc, kind, text) in enumerate(rows.events, start=1):
        shown = escape_control_characters(text)
        yield {"number": number, "time_utc": time_utc, "kind": kind, "text": shown}


def rounded(value: float, digits: int = _DIGITS) -> float | None:
    """Return a number to so many digits; None, as JSON has it, for one that is not known."""
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None


def _rounded(value: float, u: float) -> tuple[float | None, float | None]:
    """Return a value to a hundredth of its u, and the u."""
    short = rounded(u, _DIGITS_OF_U)
    if not short or not math.isfinite(value):
        return rounded(value), short
    places = _DIGITS_OF_U - 1 - math.floor(math.log10(short))
    return round(value, places), short
