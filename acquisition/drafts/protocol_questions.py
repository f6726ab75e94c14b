"""Questions for a protocol; their defaults fit the rig."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from acquisition.drafts.question import Answers, Script, choice, number, number_of, numbers, words
from acquisition.plan.plan import min_separation_deg
from acquisition.plan.pose import Pose
from instrument.config.axes import HandAxis
from instrument.config.rig import Rig

NONE = "none"
CERTIFICATES = (
    ("lambertian", "the number holds at all angles"),
    ("8/hemispherical", "incidence 8 degrees, all directions of view"),
    ("0/45", "incidence 0, view 45 degrees"),
    ("45/0", "incidence 45, view 0 degrees"),
)
_VIEW_DEG = 89.5  # largest angle from the normal at which a sample is lit and visible
_TILE = (("number", "one reflectance with its u"), (NONE, "radiance stays relative"))
_CHECKED = (10.0, -10.0, 0.0, 20.0, -20.0, 30.0, -30.0, 45.0, -45.0, 60.0, -60.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """Rig of a new protocol, and the models that a simulated sample may have.

    rig_name: as the protocol names the file. models: default parameters by the name of the model.
    """

    name: str
    rig: Rig
    rig_path: Path
    rig_name: str
    models: Mapping[str, Mapping[str, float]]


def protocol_questions(scan: Scan, answers: Answers) -> Script:
    """Yield the questions of a protocol; `answers` holds those given to the earlier ones."""
    yield words("name", "name of the scan, in reports and folders", scan.name)
    yield words("sample_name", "name of the sample", "sample")
    for key in ("width", "height"):
        text = f"{key} of the sample, in mm"
        yield number(f"sample_{key}_mm", text, 50.8, 0.0, 500.0, open_low=True)
    outlines = (("rectangle", "thin"), (NONE, "round, irregular, or so thick that its sides show"))
    yield choice("sample_outline", "outline of the sample in the picture", outlines, "rectangle")
    yield from _angles(scan.rig, answers)
    yield from _window(scan.rig, answers)
    yield number("frames_per_point", "frames averaged at each geometry", 4, 1, 1000, whole=True)
    yield from _references(scan.rig, answers)
    if not scan.rig.real:
        models = [(name, "") for name in scan.models]
        yield choice("model", "model of the simulated sample", models, "oren_nayar")


def _angles(rig: Rig, answers: Answers) -> Script:
    low, high = _limits(rig, "theta_i", 0.0)
    lamp = [angle for angle in (30.0, 45.0, 60.0) if low <= angle <= high]
    yield numbers(
        "theta_i_deg", "angles of incidence, in degrees", lamp or [_within(low, high)],
        0.0, _VIEW_DEG, 100,
    )  # fmt: skip
    default = _nearest(0.0, *_limits(rig, "dphi", -360.0, 360.0))
    text = "azimuths between lamp and camera, in degrees; 0 is the lamp's own side"
    yield numbers("dphi_deg", text, [default], -360.0, 360.0, 100)
    yield from _views(rig, answers)


def _views(rig: Rig, answers: Answers) -> Script:
    low, high = _limits(rig, "theta_r", -_VIEW_DEG)
    start, stop = _nearest(-75.0, low, high), _nearest(75.0, low, high)
    text = "view angle, in degrees, positive on the side that dphi names"
    yield number("theta_r_start_deg", f"first {text}", start, -_VIEW_DEG, _VIEW_DEG)
    yield number("theta_r_stop_deg", f"last {text}", stop, -_VIEW_DEG, _VIEW_DEG)
    span = abs(number_of(answers, "theta_r_stop_deg") - number_of(answers, "theta_r_start_deg"))
    step = 15.0 if isinstance(rig.axes.theta_r, HandAxis) else 5.0
    count = max(round(span / step), 1) + 1 if span else 1
    yield number("theta_r_num", "number of view angles, both ends included", count, 1, 2000,
                 whole=True)  # fmt: skip


def _window(rig: Rig, answers: Answers) -> Script:
    camera = rig.camera
    field = {"width": camera.field_width_mm}
    field["height"] = camera.field_width_mm * camera.height_px / camera.width_px
    for key in ("width", "height"):
        sample = number_of(answers, f"sample_{key}_mm")
        default = float(f"{min(20.0, sample / 2, field[key] / 2):.4g}")
        text = f"{key} of the patch of the sample that counts, in mm"
        yield number(f"window_{key}_mm", text, default, open_low=True)


def _references(rig: Rig, answers: Answers) -> Script:
    clear = _clear_views(rig, answers)
    yield choice("white_tile", "white tile of known reflectance", _TILE,
                 _TILE[0][0] if clear else NONE)  # fmt: skip
    if answers["white_tile"] != NONE:
        yield number("reflectance", "its reflectance, from its certificate", 0.99, 0.0, 1.0,
                     open_low=True)  # fmt: skip
        u = float(f"{0.005 * number_of(answers, 'reflectance'):.1g}")
        yield number("u_reflectance", "standard uncertainty of that (k = 1), absolute", u)
        yield choice("certificate", "geometry of that number", CERTIFICATES, "lambertian")
    drift = (("yes", "every so many points"), (NONE, "the lamp is taken as constant"))
    yield choice("drift_check", "repeated readings that follow the lamp's drift", drift,
                 drift[0][0] if clear else NONE)  # fmt: skip
    if answers["drift_check"] != NONE:
        text = "points from one drift check to the next; gonio calibrate lamp proposes a number"
        yield number("drift_every_points", text, 25, 1, 100_000, whole=True)
    if answers["white_tile"] != NONE or answers["drift_check"] != NONE:
        text = "view angle of white tile and drift check, in degrees"
        default = clear[0] if clear else 0.0
        yield number("reference_theta_r_deg", text, default, -_VIEW_DEG, _VIEW_DEG)


def _clear_views(rig: Rig, answers: Answers) -> list[float]:
    """Return the view angles in degrees at which no position of the lamp hides the surface."""
    low, high = _limits(rig, "theta_r", -_VIEW_DEG)
    lamps = list(product(_angles_of(answers, "theta_i_deg"), _angles_of(answers, "dphi_deg")))
    limit_deg = min_separation_deg(rig)
    views = [view for view in (*_CHECKED, low, high) if low <= view <= high]
    return [v for v in views if all(Pose(*lamp, v).separation_deg >= limit_deg for lamp in lamps)]


def _limits(rig: Rig, axis: str, least: float, most: float = _VIEW_DEG) -> tuple[float, float]:
    """Return the lowest and highest angle in degrees that the rig allows, from `least` to `most`.

    A motor comes to each angle from below, by its backlash.
    """
    own = rig.axes[axis]
    backlash_deg = 0.0 if isinstance(own, HandAxis) else own.backlash_deg
    return max(own.min_deg + backlash_deg, least), min(own.max_deg, most)


def _nearest(angle: float, low: float, high: float) -> float:
    return min(max(angle, low), high)


def _within(low: float, high: float) -> float:
    """Return a round angle between two limits, or the lower one if there is none."""
    middle = float(math.floor((low + high) / 2))
    return middle if low <= middle <= high else low


def _angles_of(answers: Answers, key: str) -> tuple[float, ...]:
    value = answers[key]
    if not isinstance(value, tuple):
        raise TypeError(f"{key}: {value!r} is no list")
    return value
