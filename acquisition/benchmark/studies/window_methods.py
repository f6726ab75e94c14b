"""Ways to average the measuring window: milliseconds against the bias of the radiance.

The picture is known in closed form: a Lambertian patch with a texture of smooth waves under a lamp
at a finite distance, seen through the pinhole with its cos^4. The truth is the mean over the patch,
by quadrature on the sample; no method can know it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np

from acquisition.benchmark.effort import Effort
from acquisition.benchmark.number_text import rounded, short
from acquisition.benchmark.study import Study
from acquisition.benchmark.timing import timed
from acquisition.benchmark.trial import Trial
from acquisition.measure.window import window_at
from instrument.geometry import FloatArray, lamp_direction
from instrument.pinhole import (
    Pinhole,
    apply_homography,
    area_per_pixel_mm2,
    rectangle_mm,
)

PATCH_MM = 20.0
CAMERA = Pinhole(
    beam_length_mm=800.0,
    field_width_mm=72.0,
    width_px=640,
    height_px=512,
    axis_column_px=317.0,
    axis_row_px=257.5,
    roll_deg=0.4,
)
"""The camera of the demonstration: bench_12bit."""
FRAMES_PX = ((160, 128), (640, 512), (1280, 1024))
ANGLES_DEG = ((0.0, 40.0), (40.0, 70.0), (70.0, 80.0))
_MARGIN_PX = 3
_LAMP_MM, _LAMP_DEG = 1000.0, 45.0
_WAVES_MM, _DEPTH = (9.0, 13.0), 0.05  # a texture coarser than any pixel here is long

Average = Callable[[FloatArray, float, Pinhole], float]


@dataclass(frozen=True, slots=True)
class Method:
    """`average(image, theta_r_deg, camera)` is the radiance of the patch."""

    series: str
    label: str
    average: Average
    default: bool = False
    note: str = ""


def radiance(points_mm: FloatArray) -> FloatArray:
    """Radiance of points (..., 2) of the sample, relative: texture times irradiance."""
    x, y = points_mm[..., 0], points_mm[..., 1]
    texture = 1 + _DEPTH * np.sin(2 * np.pi * x / _WAVES_MM[0] + 0.7)
    texture += _DEPTH * np.cos(2 * np.pi * y / _WAVES_MM[1] + 0.4)
    lamp = _LAMP_MM * lamp_direction(_LAMP_DEG, 0.0)
    squared = (x - lamp[0]) ** 2 + (y - lamp[1]) ** 2 + lamp[2] ** 2
    return np.asarray(texture * lamp[2] * _LAMP_MM**2 / squared**1.5)


def true_mean() -> float:
    """Mean radiance over the patch, by Gauss-Legendre quadrature on the sample."""
    t, w = np.polynomial.legendre.leggauss(60)
    x, y = np.meshgrid(t * PATCH_MM / 2, t * PATCH_MM / 2)
    return float(w @ radiance(np.stack([x, y], axis=-1)) @ w / 4)


def picture(theta_r_deg: float, camera: Pinhole) -> FloatArray:
    """What the camera sees of the patch and a little about it; nothing elsewhere.

    Each pixel is the mean over its area by 2 x 2 Gauss points.
    """
    to_plane: FloatArray = np.linalg.inv(camera.homography(theta_r_deg)).astype(np.float64)
    corners = outline(theta_r_deg, camera)
    left, top = np.floor(corners.min(axis=0)).astype(int) - _MARGIN_PX
    right, bottom = np.ceil(corners.max(axis=0)).astype(int) + _MARGIN_PX + 1
    columns, rows = np.meshgrid(np.arange(left, right), np.arange(top, bottom))
    image = np.zeros((camera.height_px, camera.width_px))
    for across in (-1, 1):
        for down in (-1, 1):
            at = columns + across / np.sqrt(12), rows + down / np.sqrt(12)
            seen = radiance(apply_homography(to_plane, np.stack(at, axis=-1).astype(np.float64)))
            image[top:bottom, left:right] += seen * camera.cos4(*at) / 4
    return image


def outline(theta_r_deg: float, camera: Pinhole) -> FloatArray:
    """The patch's corners in the picture, (4, 2) as (column, row)."""
    return camera.project(rectangle_mm(PATCH_MM, PATCH_MM), theta_r_deg)


def crop(image: FloatArray, theta_r_deg: float, camera: Pinhole) -> float:
    """Plain mean over the upright rectangle about the patch."""
    corners = outline(theta_r_deg, camera)
    (left, top), (right, bottom) = (
        np.rint(f(axis=0)).astype(int) for f in (corners.min, corners.max)
    )
    return float(image[top : bottom + 1, left : right + 1].mean())


def mask(image: FloatArray, theta_r_deg: float, camera: Pinhole) -> float:
    """Plain mean over the pixels whose centres lie within the patch."""
    inside = np.zeros(image.shape, np.uint8)
    corners = outline(theta_r_deg, camera)
    cv2.fillConvexPoly(inside, np.rint(corners * 16).astype(np.int32), 1, shift=4)
    return float(image[inside > 0].mean())


def supersampled(image: FloatArray, theta_r_deg: float, camera: Pinhole, parts: int) -> float:
    """Coverage by parts x parts points a pixel; each pixel weighted by the area that it sees."""
    homography = camera.homography(theta_r_deg)
    corners = outline(theta_r_deg, camera)
    first = np.floor(corners.min(axis=0)).astype(int)
    columns, rows = np.ceil(corners.max(axis=0)).astype(int) - first + 1
    offset = (np.arange(parts) + 0.5) / parts - 0.5
    x = (np.arange(columns)[:, None] + offset).ravel()
    y = (np.arange(rows)[:, None] + offset).ravel()
    inside = np.ones((y.size, x.size), dtype=bool)
    shape = corners - first
    (a, b), (c, d) = shape[1] - shape[0], shape[2] - shape[1]
    turn = np.sign(a * d - b * c)
    for corner, following in zip(shape, np.roll(shape, -1, axis=0), strict=True):
        along, across = following - corner
        inside &= turn * (along * (y[:, None] - corner[1]) - across * (x - corner[0])) >= 0
    covered = inside.reshape(rows, parts, columns, parts).mean(axis=(1, 3))
    at = first[0] + np.arange(columns), (first[1] + np.arange(rows))[:, None]
    area = covered * area_per_pixel_mm2(homography, *at)
    part = image[first[1] : first[1] + rows, first[0] : first[0] + columns]
    return float(np.vdot(area / camera.cos4(*at), part) / area.sum())


def coverage(image: FloatArray, theta_r_deg: float, camera: Pinhole) -> float:
    """The program's own: exact coverage, each pixel weighted by the area that it sees."""
    # Without the memory of windows already made, which a scan has and a first picture has not.
    window = window_at.__wrapped__(theta_r_deg, camera, PATCH_MM, PATCH_MM)
    return window.mean(image[window.crop])


METHODS = (
    Method("whole pixels", "crop", crop, note="upright rectangle, plain mean"),
    Method("whole pixels", "mask", mask, note="pixels with their centre inside, plain mean"),
    *(
        Method(
            "supersampled", f"{n} × {n} points", partial(supersampled, parts=n),
            note="coverage by points, weights by area",
        )
        for n in (1, 2, 4, 8)
    ),
    Method("exact", "exact coverage", coverage, True, note="coverage in closed form, by area"),
)  # fmt: skip


def window_studies(effort: Effort) -> tuple[Study, Study]:
    """By frame size over all view angles, and by view angle with the demonstration's camera."""
    return _by_frame(effort), _by_angle(effort)


def _by_frame(effort: Effort) -> Study:
    views = np.linspace(-78.0, 79.0, effort.frame_views)
    sizes = FRAMES_PX if effort.thorough else FRAMES_PX[:2]
    scenes = {f"{w} × {h} pixels": (_scaled(w), views) for w, h in sizes}
    trials = _trials("window", scenes, effort)
    return Study(
        "window",
        "Measuring window: how its pixels are averaged",
        "time per view angle (ms)",
        "bias of the radiance, worst (relative)",
        _frame_caption(trials, list(scenes)[1]),
        f"quadrature over the patch of {PATCH_MM:g} mm; waves of {_DEPTH:.0%} on the sample; view "
        f"angles to ±79°",
        trials,
    )


def _by_angle(effort: Effort) -> Study:
    count = max(effort.frame_views // 3, 2)
    scenes = {
        f"{low:g}–{high:g}°": (CAMERA, np.concatenate([views, -views]))
        for low, high in ANGLES_DEG
        for views in [np.linspace(low + 1, high, count)]
    }
    trials = _trials("window_angles", scenes, effort)
    return Study(
        "window_angles",
        "Measuring window: where whole pixels fail",
        "time per view angle (ms)",
        "bias of the radiance, worst (relative)",
        _angle_caption(trials, list(scenes)),
        f"as above, {CAMERA.width_px} × {CAMERA.height_px} pixels, by view angle",
        trials,
    )


def _frame_caption(trials: Sequence[Trial], scene: str) -> str:
    own = {t.label: t for t in trials if t.scene == scene}
    exact, upright = own["exact coverage"], own["crop"]
    two = own["2 × 2 points"]
    return (
        f"With {scene} exact coverage is off by {short(exact.error)} at the worst, and costs "
        f"{rounded(exact.cost / two.cost)} times what 2 × 2 points a pixel do; what is left "
        "belongs to the pixels, not to the method.\nAn upright crop costs "
        f"{rounded(upright.cost / exact.cost)} times as much and is off by "
        f"{short(upright.error)}: it sees another patch at every angle, and counts the sample’s "
        "near side too much."
    )


def _angle_caption(trials: Sequence[Trial], scenes: Sequence[str]) -> str:
    def worst(label: str, scene: str) -> str:
        return short(next(t.error for t in trials if (t.label, t.scene) == (label, scene)))

    first, last = scenes[0], scenes[-1]
    return (
        "Towards grazing the patch is narrow, and its edges are much of it: a crop is off by "
        f"{worst('crop', first)} at {first} and {worst('crop', last)} at {last}, a mask by "
        f"{worst('mask', first)} and {worst('mask', last)}.\nExact coverage stays at "
        f"{worst('exact coverage', first)} and {worst('exact coverage', last)}."
    )


def _scaled(width_px: int) -> Pinhole:
    """The demonstration's camera with pixels of another size."""
    scale = width_px / CAMERA.width_px
    column, row = ((a + 0.5) * scale - 0.5 for a in (CAMERA.axis_column_px, CAMERA.axis_row_px))
    height = round(CAMERA.height_px * scale)
    return replace(
        CAMERA, width_px=width_px, height_px=height, axis_column_px=column, axis_row_px=row
    )


def _trials(
    study: str, scenes: dict[str, tuple[Pinhole, FloatArray]], effort: Effort
) -> tuple[Trial, ...]:
    true = true_mean()
    trials = []
    for scene, (camera, views) in scenes.items():
        images = [picture(float(view), camera) for view in views]
        for method in METHODS:
            trials.append(_trial(study, scene, method, camera, images, views, true, effort.repeats))
    return tuple(trials)


def _trial(
    study: str,
    scene: str,
    method: Method,
    camera: Pinhole,
    images: list[FloatArray],
    views: FloatArray,
    true: float,
    repeats: int,
) -> Trial:
    """The bias is that of the values that were timed, one at each view angle."""

    def action() -> FloatArray:
        pairs = zip(images, views, strict=True)
        return np.array([method.average(image, float(view), camera) for image, view in pairs])

    time = timed(action, repeats)
    off = np.abs(time.value / true - 1)
    return Trial(
        study,
        scene,
        method.series,
        method.label,
        1e3 * time.least_s / views.size,
        float(np.max(off)),
        float(np.median(off)),
        method.default,
        note=method.note,
        more={"spread_of_cost": time.spread},
    )
