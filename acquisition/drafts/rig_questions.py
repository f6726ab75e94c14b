"""Questions for a rig file: camera, distances, axes, calibration, lamp."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from acquisition.drafts.axis_questions import axis_questions
from acquisition.drafts.calibrated import Calibrated, lamp_flicker
from acquisition.drafts.question import Answers, Question, Script, choice, number, words
from acquisition.drafts.yaml_words import Value, in_comment
from drivers.discovery import FoundPort
from drivers.v4l2.listing import FoundCamera
from instrument.calibration.geometry_file import read_geometry_file
from instrument.config.axes import AXES, EMULATED
from instrument.errors import InputError
from instrument.text.quoting import shown

SIMULATED, NONE = "simulated", "none"
DEPTHS = {"Y16": (9, 16, 12), "Y10": (10, 10, 10), "GREY": (8, 8, 8), "YUYV": (8, 8, 8)}
"""Pixel formats that the program can use, the best first: least, most and usual bits."""
_FORMAT_TEXTS = {
    "Y16": "up to 16 bits a pixel",
    "Y10": "10 bits",
    "GREY": "8 bits",
    "YUYV": "8 bits, with colours that are not used",
}
_SIZE = re.compile(r"([0-9]{1,5}) ?[x×] ?([0-9]{1,5})")


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """Files and devices that the questions offer.

    folder: of the new file; name: its name without the ending. calibrations, lamp_calibrations,
    geometries: files of `gonio calibrate camera`, `lamp` and `geometry` in that folder.
    """

    folder: Path
    name: str
    cameras: Sequence[FoundCamera] = ()
    ports: Sequence[FoundPort] = ()
    calibrations: Sequence[Path] = ()
    lamp_calibrations: Sequence[Path] = ()
    geometries: Sequence[Path] = ()

    def usable(self) -> list[FoundCamera]:
        """Return the cameras with a pixel format that the program can use."""
        return [camera for camera in self.cameras if set(camera.formats) & set(DEPTHS)]

    def camera(self, answers: Answers) -> FoundCamera | None:
        """Return what was found of the camera that was chosen; None if it is not connected."""
        return next((c for c in self.cameras if c.device == answers["camera"]), None)


def rig_questions(bench: Bench, answers: Answers) -> Script:
    """Yield the questions of a rig file; `answers` holds those given to the earlier ones."""
    yield _camera(bench)
    yield words("name", "name of the rig, in reports and messages", bench.name)
    yield number("beam_length_mm", "lens to the rotation axis, in mm", 800.0, open_low=True)
    yield number("lens_diameter_mm", "diameter of the lens's aperture, in mm", 15.6)
    yield number("lamp_distance_mm", "lamp to the sample, in mm", 1000.0, open_low=True)
    yield number("lamp_diameter_mm", "diameter of the lamp's light source, in mm", 25.2)
    yield number(
        "blocked_half_angle_deg",
        "camera and lamp hide one another when closer than this, in degrees",
        3.0, 0.0, 89.0, open_low=True,
    )  # fmt: skip
    for axis in AXES:
        yield from axis_questions(axis, bench.ports, answers, simulated=is_simulated(answers))
    yield from _picture(bench, answers)
    yield _calibration(bench, answers)
    yield _lamp_calibration(bench)
    yield number(
        "white_exposure_s",
        "exposure at which white paper, lit straight on, fills 0.7 of full scale, in seconds",
        0.035, 1e-4, 1e4,
    )  # fmt: skip
    if is_simulated(answers):
        offers = (("shutter", "it opens and closes by itself"), ("hand", "the operator covers it"))
        yield choice("darkened_by", "darkening of the lamp", offers, "shutter")


def is_simulated(answers: Answers) -> bool:
    """Return True if the camera that was chosen, and so the whole rig, is simulated."""
    return answers["camera"] == SIMULATED


def size_px(answers: Answers) -> tuple[int, int]:
    """Return the width and height of the picture in pixels."""
    width, height = str(answers["camera.size"]).split(" x ")
    return int(width), int(height)


def _camera(bench: Bench) -> Question:
    found = bench.usable()
    offers = [
        (camera.device, f"{in_comment(camera.card)}: {', '.join(camera.formats)}")
        for camera in found
    ]
    offers.append((SIMULATED, "the whole rig: nothing real is needed, nothing moves"))
    default = found[0].device if found else SIMULATED
    return choice("camera", "camera of the rig", offers, default, other=_device)


def _device(answer: str) -> str:
    """Return the path of a camera that was not found: it may be connected later."""
    if not answer.startswith("/") or len(answer) > 200 or answer == EMULATED:
        raise InputError(
            f"{shown(answer)}; allowed: the number of a camera, simulated, or a path such as "
            "/dev/v4l/by-id/..."
        )
    return answer


def _picture(bench: Bench, answers: Answers) -> Script:
    found = bench.camera(answers)
    if not is_simulated(answers):
        yield from _format(found, answers)
    form = str(answers.get("camera.pixel_format", "Y16"))
    yield _size(() if found is None else found.formats[form], is_simulated(answers))
    low, high, usual = (8, 16, 12) if is_simulated(answers) else DEPTHS[form]
    if low < high:
        yield number("camera.bit_depth", "bits of a count", usual, low, high, whole=True)
    if found is not None and found.gain is not None and found.gain.value is not None:
        gain = found.gain
        yield number(
            "camera.gain", "gain in the camera's own unit", found.gain.value,
            gain.minimum, gain.maximum, whole=True,
        )  # fmt: skip
    yield _geometry(bench, answers)
    if answers["geometry"] != NONE:
        return
    yield number(
        "camera.field_width_mm",
        "width of what the picture shows at the sample, in mm",
        72.0, open_low=True,
    )  # fmt: skip


def _format(found: FoundCamera | None, answers: Answers) -> Script:
    known = [f for f in DEPTHS if found is None or f in found.formats]
    offers = [(name, _FORMAT_TEXTS[name]) for name in known]
    yield choice("camera.pixel_format", "pixel format", offers, known[0])
    if answers["camera.pixel_format"] == "YUYV":
        # A driver that states no range means the limited one: see `drivers.v4l2.ioctl`.
        full = found is not None and found.limited_range is False
        ranges = (("limited", "black is 16 and white 235"), ("full", "0 to 255"))
        yield choice("camera.luma_range", "range of its counts", ranges, ranges[full][0])


def _size(offered: Sequence[str], simulated: bool) -> Question:
    """Question of the picture's size: one of those offered, or any where none are."""
    listed = [size for size in offered if _SIZE.fullmatch(size)]
    usual = "640 x 512" if simulated else "640 x 480"
    text = "size of the picture in pixels, width x height"
    if listed:
        largest = max(listed, key=_pixels)
        return choice("camera.size", text, [(size, "") for size in listed], largest)
    span = f"; the camera offers {', '.join(offered)}" if offered else ""
    return Question(
        key="camera.size", text=text, default=usual, parse=_any_size,
        allowed=f"such as {usual}, each from 16 to 16384{span}",
    )  # fmt: skip


def _pixels(size: str) -> int:
    width, height = size.split(" x ")
    return int(width) * int(height)


def _any_size(answer: str) -> Value:
    found = _SIZE.fullmatch(answer.strip())
    if found is None or not all(16 <= int(side) <= 16384 for side in found.groups()):
        raise InputError(f"{shown(answer)}; allowed: width x height, each from 16 to 16384 pixels")
    return f"{int(found[1])} x {int(found[2])}"


def _calibration(bench: Bench, answers: Answers) -> Question:
    """Question of the file that fills in the camera's noise, gain and response."""

    def require(path: Path) -> None:
        Calibrated.of(path).require_fit(path.name, *size_px(answers))

    text = "calibration of the camera"
    return _file("calibration", text, bench.folder, bench.calibrations, require)


def _geometry(bench: Bench, answers: Answers) -> Question:
    """Question of the file that gives the place and scale of the picture, and theta_r's zero."""

    def require(path: Path) -> None:
        width, height = size_px(answers)
        if read_geometry_file(path).size_px != (width, height):
            raise InputError(
                f"{path.name}: is of a camera with pictures of another size; allowed: {width} x "
                f"{height}, as answered before"
            )

    text = "calibration of the geometry"
    return _file("geometry", text, bench.folder, bench.geometries, require)


def _lamp_calibration(bench: Bench) -> Question:
    """Question of the file that fills in the lamp's flicker."""
    text = "calibration of the lamp"
    return _file("lamp_calibration", text, bench.folder, bench.lamp_calibrations, lamp_flicker)


def _file(
    key: str,
    text: str,
    folder: Path,
    found: Sequence[Path],
    require: Callable[[Path], object],
) -> Question:
    """Question of a file of a calibration or none; `require` raises `InputError` for a wrong one.

    The answer is its path from `folder`.
    """
    offers = [(path.name, "") for path in found]
    offers.append((NONE, "usual values, marked as assumed"))

    def parse(answer: str) -> str:
        if answer == NONE:
            return NONE
        require(folder / answer)
        return os.path.relpath(folder / answer, folder)

    allowed = "a file's name, from the folder of the new file, or none"
    return replace(choice(key, text, offers, NONE), parse=parse, allowed=allowed)
