"""Rows of the run record: a measured geometry, a drift check at a resume, a preview, a choice."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Literal, NamedTuple

from instrument.devices import Surface
from instrument.record.event_kinds import CHOSEN

Kind = Literal["point", "tile", "drift"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """One measured geometry in counts (DN): the mean over the window, its uncertainties, its flags.

    `step` is its number in the plan. Angles in degrees, theta_r signed. `signal_dn` is the
    area-weighted mean over the window and all frames, dark subtracted, divided by cos^4. The u are
    its standard uncertainties: `u_noise_dn` from photon and read-out noise and from what frames
    scatter beyond it (flicker, black level), `u_quantisation_dn` from rounding the frames to whole
    counts, `u_dark_dn` from the dark (shared by all readings of one exposure), `u_placement_dn`
    from the height of the surface above the axis (signed: one placement shifts all its readings
    together; without the part that depends on the reflectance), and `u_texture_dn` from the texture
    at the window's edge, to second order of the placement, and from hot pixels, which are left out,
    and saturated ones. `window_pixels`: the area that counts. `patch_dn`: level of the rig's dark
    patch, dark subtracted, with the u of its noise; the six after it: what would fall into window
    and patch if the lens scattered all light of the picture near by, farther and far, see
    `acquisition.measure.stray_light`. All are 0 without a patch. Stray light is in `signal_dn`.
    `lamp_setting` counts the positions of the lamp, `block` the times that it was set by hand.
    `blur_deg`: by how much theta_r turned during the exposure, 0 at rest; `theta_r_deg` is the mean
    over it, `u_turn_deg` its standard uncertainty by the time stamps, and `u_latency_deg` (signed:
    the directions of turning have opposite signs) that by the latency between camera and axis,
    which all readings of one exposure share.
    `u_pixel_dn`: u of the signal by photon and read-out noise alone. `scatter_dn`: standard
    deviation of the window's mean from frame to frame, 0 for a single frame.
    `time_s` is the scan time at the middle of the frames, without interruptions of the scan;
    `free_s` is the time at which the rig could move on, the dark having been taken.
    """

    step: int
    kind: Kind
    surface: Surface
    theta_i_deg: float
    dphi_deg: float
    theta_r_deg: float
    lamp_setting: int
    block: int
    signal_dn: float
    u_noise_dn: float
    u_quantisation_dn: float
    u_dark_dn: float
    u_placement_dn: float
    u_texture_dn: float
    exposure_s: float
    frames: int
    window_pixels: float
    saturated_pixels: int
    peak_dn: float
    time_s: float
    free_s: float
    time_utc: str
    flags: str
    patch_dn: float = 0.0
    u_patch_dn: float = 0.0
    near_window_dn: float = 0.0
    middle_window_dn: float = 0.0
    far_window_dn: float = 0.0
    near_patch_dn: float = 0.0
    middle_patch_dn: float = 0.0
    far_patch_dn: float = 0.0
    blur_deg: float = 0.0
    u_turn_deg: float = 0.0
    u_latency_deg: float = 0.0
    u_pixel_dn: float = 0.0
    scatter_dn: float = 0.0

    @property
    def u_light_dn(self) -> float:
        """Standard uncertainty of the light at this place: of noise, rounding and the dark, in DN.

        Several exposures of a quiet 8-bit sensor have the same rounding: noise alone says little.
        """
        return math.hypot(self.u_noise_dn, self.u_quantisation_dn, self.u_dark_dn)


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """Drift check at a resume, or one that ended the scan.

    `reading.step`: the drift check of the plan that it repeats, or is. `before_step`: the first
    step of the plan after it. `expected`: counts per second that earlier
    checks predict; `u_expected`: standard uncertainty of the difference from it. `jumped`: the
    lamp's level has changed, so its drift is followed anew from this check on.
    """

    before_step: int
    expected: float
    u_expected: float
    jumped: bool
    reading: Reading


@dataclass(frozen=True, slots=True)
class Preview:
    """PNG picture for the report and the window's outline, (N, 2) pixels as (column, row)."""

    step: int
    caption: str
    png: bytes
    polygon: list[list[float]]


class Rows(NamedTuple):
    """Readings, drift checks at resumes, and events (time, kind, text) of a record, in order."""

    readings: Sequence[Reading]
    checks: Sequence[Check]
    events: Sequence[tuple[str, str, str]]


MOST_FRAMES = 100_000
"""Frames of one step."""

_MOST_STEP = 2**53
_PLAIN = re.compile(r"([A-Za-z0-9][ -~]{0,99})?", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Steps that a scan chose to measure next: the text of an event of the kind `chosen`.

    number: of the batch, from 0. steps: their numbers in the list of all, in the order in which
    they are measured. frames, reasons: of each step. model, verdict: of the fit that the choice is
    based on, empty without one; fitted: u of the parameters asked for by that fit; forecast: what
    it would be after the batch before this one; checked: what a full fit then found, empty where
    none was made. In the parameters' units; None for a u that is not known. seconds: expected time
    of the scan to the end of the batch. end: why nothing is chosen after it, else empty.
    """

    number: int
    steps: tuple[int, ...]
    frames: tuple[int, ...]
    reasons: tuple[str, ...]
    model: str = ""
    verdict: str = ""
    fitted: Mapping[str, float | None] = field(default_factory=dict)
    forecast: Mapping[str, float | None] = field(default_factory=dict)
    checked: Mapping[str, float | None] = field(default_factory=dict)
    seconds: float = 0.0
    end: str = ""

    @property
    def text(self) -> str:
        """The batch as JSON."""
        return json.dumps(asdict(self), allow_nan=False)

    @classmethod
    def of_text(cls, text: str) -> Batch:
        """Return the batch of a text from anywhere; `ValueError` says what is wrong with it."""
        try:
            data = json.loads(text)
        except RecursionError:
            raise ValueError("is nested too deeply") from None
        if not isinstance(data, dict) or set(data) != {f.name for f in fields(cls)}:
            raise ValueError(f"allowed: JSON with {', '.join(f.name for f in fields(cls))}")
        for name, allowed in _RULES.items():
            if not _FITS[allowed](data[name]):
                raise ValueError(f"{name} is {str(data[name])[:40]!r}; allowed: {allowed}")
        for name in ("frames", "reasons"):
            if len(data[name]) != len(data["steps"]):
                raise ValueError(f"{len(data[name])} {name} for {len(data['steps'])} steps")
        lists = {name: tuple(data[name]) for name in ("steps", "frames", "reasons")}
        return cls(**{**data, **lists})


def batches_of(events: Iterable[tuple[str, str, str]]) -> list[Batch]:
    """Return the choices among events (time, kind, text), in their order."""
    return [Batch.of_text(text) for _, kind, text in events if kind == CHOSEN]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_step(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= _MOST_STEP


def _is_count(value: Any) -> bool:
    return _is_step(value) and 1 <= value <= MOST_FRAMES


def _are_steps(value: Any) -> bool:
    own = isinstance(value, list) and all(map(_is_step, value))
    return own and len(set(value)) == len(value)


def _is_plain(value: Any) -> bool:
    """Return True for a text that may stand in a cell of a table: no formula of a spreadsheet."""
    return isinstance(value, str) and _PLAIN.fullmatch(value) is not None


def _is_u(value: Any) -> bool:
    return isinstance(value, dict) and all(
        isinstance(name, str) and (u is None or (_is_number(u) and u >= 0))
        for name, u in value.items()
    )


_STEP, _STEPS, _TEXT = "a whole number", "different whole numbers", "a text"
_FRAMES = f"whole numbers from 1 to {MOST_FRAMES}"
_TEXTS, _U, _SECONDS = "plain words in ASCII", "u by name, 0 or more, or null", "a number"
_RULES = {
    "number": _STEP, "steps": _STEPS, "frames": _FRAMES, "reasons": _TEXTS, "model": _TEXT,
    "verdict": _TEXT, "fitted": _U, "forecast": _U, "checked": _U, "seconds": _SECONDS,
    "end": _TEXT,
}  # fmt: skip
_FITS = {
    _STEP: _is_step,
    _STEPS: _are_steps,
    _FRAMES: lambda value: isinstance(value, list) and all(map(_is_count, value)),
    _TEXT: lambda value: isinstance(value, str),
    _TEXTS: lambda value: isinstance(value, list) and all(map(_is_plain, value)),
    _U: _is_u,
    _SECONDS: _is_number,
}
