"""Text of a rig file made of answers; each line says in a comment what it is."""

from __future__ import annotations

import math
from collections.abc import Iterator

from acquisition.drafts.axis_questions import USUAL, connection
from acquisition.drafts.calibrated import USUAL_WANDER_DN, Calibrated, lamp_flicker
from acquisition.drafts.question import Answers, number_of
from acquisition.drafts.rig_questions import DEPTHS, NONE, Bench, is_simulated, size_px
from acquisition.drafts.yaml_words import in_comment, line
from instrument.calibration.geometry_file import GeometryCalibration, read_geometry_file
from instrument.config.axes import AXES
from instrument.config.camera import LIMITED_BLACK_DN, LIMITED_WHITE_DN, V4L2_EXPOSURE_STEP_S

_TARGET = 0.7  # of full scale, as in the question of white_exposure_s
_ASSUMED = "assumed: gonio calibrate camera measures it"
_LIMITS_S = (0.0005, 2.0)  # shortest and longest exposure where a camera states none
_WELL = 30000.0  # electrons of a common sensor with pixels of 5 to 6 um (assumed)
_READ_NOISE = 8.0


def rig_text(bench: Bench, answers: Answers) -> str:
    """Return the whole file."""
    return "\n".join(_lines(bench, answers)) + "\n"


def _lines(bench: Bench, answers: Answers) -> Iterator[str]:
    simulated = is_simulated(answers)
    kind = "simulated in all its parts" if simulated else "with real devices"
    yield f"# A rig {kind}, as answered in `gonio new rig`."
    yield '# "assumed" marks what nobody was asked: compare it with your rig.'
    yield line("name", answers["name"], "in reports and messages")
    yield ""
    yield from _distances(answers)
    yield ""
    found = _geometry(bench, answers)
    if found is not None:
        yield f"# Geometry with {in_comment(found.camera)}, {found.date_utc[:10]}: it gives the"
        yield "# camera's scale, axis and roll, which are not typed here, and the zero of theta_r."
        yield line("geometry", answers["geometry"], "of gonio calibrate geometry")
        yield ""
    yield "axes:                          # each as gonio move and gonio devices --rig name it"
    for axis in AXES:
        yield from _axis(axis, answers, found)
    yield ""
    yield "# Forbidden zones, checked on the whole path of each move; remove the # of both lines:"
    yield "# keep_out:"
    yield "#   - {name: cable post behind the table, theta_r_deg: [-90.0, -87.0]}"
    yield ""
    yield from _camera(bench, answers)
    yield ""
    yield from _lamp(bench, answers)
    if simulated:
        yield ""
        yield from _simulation()


def _distances(answers: Answers) -> Iterator[str]:
    beam, lamp = number_of(answers, "beam_length_mm"), number_of(answers, "lamp_distance_mm")
    source, lens = number_of(answers, "lamp_diameter_mm"), number_of(answers, "lens_diameter_mm")
    yield line("beam_length_mm", beam, "entrance pupil of the lens to the rotation axis")
    yield line("lamp_distance_mm", lamp, "lamp to the rotation axis")
    of_lamp = f"of the lamp, seen from the sample: {source:g} mm across"
    yield line("source_solid_angle_sr", _cone_sr(source, lamp), of_lamp)
    of_lens = f"of the lens, seen from the sample: {lens:g} mm across"
    yield line("receiver_solid_angle_sr", _cone_sr(lens, beam), of_lens)
    blocked = "camera and lamp housings hide one another when closer than this"
    yield line("blocked_half_angle_deg", answers["blocked_half_angle_deg"], blocked)
    yield line("u_placement_mm", 0.2, "assumed: how well the sample's surface stands on the axis")
    yield line("swap_s", 45.0, "assumed: to change sample and white tile")


def _cone_sr(diameter_mm: float, distance_mm: float) -> float:
    """Return the solid angle in sr of a disc seen from a point on its axis."""
    # 1 - cos of its half angle, without the loss of digits of that difference
    half = math.atan2(diameter_mm / 2, distance_mm)
    return float(f"{4 * math.pi * math.sin(half / 2) ** 2:.6g}")


def _geometry(bench: Bench, answers: Answers) -> GeometryCalibration | None:
    named = answers["geometry"]
    return None if named == NONE else read_geometry_file(bench.folder / str(named))


def _zero(name: str, answers: Answers, found: GeometryCalibration | None) -> tuple[float, int, str]:
    """Return what an axis's device reads at 0, its sign, and how that is known."""
    if found is None or name != "theta_r" or is_simulated(answers):
        return 0.0, 1, "assumed"
    return float(f"{found.zero_deg:.6g}"), found.sign, "calibrated"


def _axis(name: str, answers: Answers, found: GeometryCalibration | None) -> Iterator[str]:
    driver = str(answers[f"{name}.driver"])
    yield f"  {name}:".ljust(31) + f"# {USUAL[name].text}"
    yield line("driver", driver, "hand: the operator sets it" if driver == "hand" else "", 4)
    if f"{name}.port" in answers:
        yield line("port", answers[f"{name}.port"], "", 4)
    for key in connection(name, answers):
        yield line(key, answers[f"{name}.{key}"], "", 4)
    yield line("min_deg", answers[f"{name}.min_deg"], "software limits: no move goes past them", 4)
    yield line("max_deg", answers[f"{name}.max_deg"], "", 4)
    zero_deg, sign, known = _zero(name, answers, found)
    if driver == "hand":
        if found is not None and name == "theta_r":
            yield line("zero_deg", zero_deg, f"{known}: what its scale shows at 0", 4)
            yield line("sign", sign, f"{known}: -1 if the scale counts the other way", 4)
        yield line("u_deg", 0.25, "assumed: a protractor read to half a degree (k = 1)", 4)
        yield line("set_s", 60.0, "assumed: time to set it", 4)
        return
    speed = number_of(answers, f"{name}.speed_deg_per_s")
    yield line("zero_deg", zero_deg, f"{known}: what the device reads when the axis is at 0", 4)
    yield line("sign", sign, f"{known}: -1 if the device counts the other way", 4)
    yield line("speed_deg_per_s", speed, "of every move", 4)
    yield line("acceleration_deg_per_s2", 2 * speed, "assumed: full speed after half a second", 4)
    yield line("settle_s", 0.3, "assumed: the beam swings after a move", 4)
    yield line("backlash_deg", 0.5, "assumed: every angle is approached from below by this", 4)
    if driver != "simulated":
        yield line("homing_s", 60.0, "assumed: the longest search for the reference", 4)
    yield line("u_deg", 0.02, "assumed: standard uncertainty of an angle (k = 1)", 4)


def _camera(bench: Bench, answers: Answers) -> Iterator[str]:
    width, height = size_px(answers)
    yield "camera:"
    yield from _driver(bench, answers)
    yield line("width_px", width, "size of the picture", 2)
    yield line("height_px", height, "", 2)
    if answers["geometry"] == NONE:
        yield from _place(answers)
    yield line("bit_depth", _bit_depth(answers), "of a count", 2)
    yield from _sensor(bench, answers)
    low, high, source = _exposures_s(bench, answers)
    yield line("min_exposure_s", low, source, 2)
    yield line("max_exposure_s", high, source, 2)
    yield line("frame_overhead_s", 0.02, "assumed: from the end of an exposure to the next", 2)


def _place(answers: Answers) -> Iterator[str]:
    """Yield the lines of scale and place of the picture, which nobody has calibrated."""
    width, height = size_px(answers)
    field = "of the picture's width, at the rotation axis"
    yield line("field_width_mm", answers["camera.field_width_mm"], field, 2)
    middle = "assumed: the middle; gonio calibrate geometry finds the axis"
    yield line("axis_row_px", (height - 1) / 2, middle, 2)
    yield line("axis_column_px", (width - 1) / 2, "", 2)
    yield line("roll_deg", 0.0, "assumed: turn of the picture about the lens's axis", 2)


def _driver(bench: Bench, answers: Answers) -> Iterator[str]:
    if is_simulated(answers):
        yield line("driver", "simulated", "", 2)
        return
    found = bench.camera(answers)
    yield line("driver", "v4l2", "" if found is None else f"{found.card} ({found.driver})", 2)
    yield line("device", answers["camera"], "", 2)
    yield line("pixel_format", answers["camera.pixel_format"], "", 2)
    if "camera.luma_range" in answers:
        yield line("luma_range", answers["camera.luma_range"], "limited: white is 235", 2)
    if "camera.gain" in answers:
        yield line("gain", answers["camera.gain"], "in the camera's own unit", 2)


def _sensor(bench: Bench, answers: Answers) -> Iterator[str]:
    """Yield the lines of noise and gain: measured ones where there is a calibration."""
    values = {
        "full_well_electrons": (_WELL, _ASSUMED),
        "read_noise_electrons": (_READ_NOISE, _ASSUMED),
        "dark_current_electrons_per_s": (20.0, _ASSUMED),
        "black_level_dn": (_black_dn(answers), _ASSUMED),
        "u_black_level_dn": (USUAL_WANDER_DN, "assumed: of the black level, from frame to frame"),
    }
    values |= {k: v for k, v in _calibrated(bench, answers).items() if k in values}
    if answers["calibration"] != NONE:
        calibration = Calibrated.of(bench.folder / str(answers["calibration"]))
        yield f"  # Calibration of {in_comment(calibration.source())}"
        yield line("calibration", answers["calibration"], "counts are made linear with it", 2)
    for key, (value, comment) in values.items():
        yield line(key, value, comment, 2)


def _calibrated(bench: Bench, answers: Answers) -> dict[str, tuple[float, str]]:
    if answers["calibration"] == NONE:
        return {}
    return Calibrated.of(bench.folder / str(answers["calibration"])).values(_max_dn(answers))


def _bit_depth(answers: Answers) -> int:
    if "camera.bit_depth" in answers:
        return int(number_of(answers, "camera.bit_depth"))
    return DEPTHS[str(answers["camera.pixel_format"])][0]


def _max_dn(answers: Answers) -> int:
    limited = answers.get("camera.luma_range") == "limited"
    return LIMITED_WHITE_DN if limited else int(2 ** _bit_depth(answers) - 1)


def _black_dn(answers: Answers) -> float:
    """Return a usual black level: 1/64 of full scale, or that of the limited range."""
    if answers.get("camera.luma_range") == "limited":
        return float(LIMITED_BLACK_DN)
    return float(2 ** _bit_depth(answers)) / 64


def _exposures_s(bench: Bench, answers: Answers) -> tuple[float, float, str]:
    """Return the shortest and longest exposure in s, and their source."""
    found = bench.camera(answers)
    control = None if found is None else found.exposure
    if control is None or control.maximum < max(control.minimum, 1):
        return *_LIMITS_S, "assumed"
    low, high = (
        round(n * V4L2_EXPOSURE_STEP_S, 4) for n in (max(control.minimum, 1), control.maximum)
    )
    return low, high, "of its exposure control"


def _lamp(bench: Bench, answers: Answers) -> Iterator[str]:
    values = _calibrated(bench, answers)
    well = values.get("full_well_electrons", (_WELL, ""))[0]
    flicker, source = values.get("u_flicker", (0.003, "assumed: relative, from frame to frame"))
    if answers["lamp_calibration"] != NONE:
        flicker, source = lamp_flicker(bench.folder / str(answers["lamp_calibration"]))
    exposure_s = number_of(answers, "white_exposure_s")
    yield "lamp:"
    yield line("driver", "simulated" if is_simulated(answers) else "manual", "", 2)
    by = answers.get("darkened_by", "hand")
    yield line("darkened_by", by, "hand: the operator covers it for darks", 2)
    if by == "hand":
        yield line("cover_s", 15.0, "assumed: time to cover it", 2)
    else:
        yield line("shutter_s", 0.1, "assumed: time of the shutter", 2)
    rate = float(f"{_TARGET * well / exposure_s:.6g}")
    white = f"of a pixel that sees white: {_TARGET:g} of full scale in {exposure_s:g} s"
    yield line("white_electrons_per_s", rate, white, 2)
    yield line("u_flicker", min(flicker, 0.5), source, 2)


def _simulation() -> Iterator[str]:
    yield "simulation:                    # what the fit never sees; docs/rigs.md lists defects"
    yield line("seed", 1, "of all noise", 2)
    yield line("sample_height_mm", 0.15, "above the rotation axis", 2)
    yield line("lamp_drift_per_hour", 0.01, "relative", 2)
