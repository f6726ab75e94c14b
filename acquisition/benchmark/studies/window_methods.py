"""Methods to average the measuring window: time per view against the bias of the radiance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import cv2
import numpy as np

from acquisition.benchmark.effort import Effort
from acquisition.benchmark.number_text import rounded, short
from acquisition.benchmark.studies.method import Method
from acquisition.benchmark.study import Study
from acquisition.benchmark.timing import timed
from acquisition.benchmark.trial import Trial, select
from acquisition.benchmark.window_truth import (
    PATCH_MM,
    WAVE_DEPTH,
    outline,
    patch_mean,
    picture,
    radiance,
    shipped_camera,
)
from acquisition.measure.window import window_at
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole, area_per_pixel_mm2

FRAMES_PX = (160, 640, 1280)
"""Widths of the pictures; 640 is that of the demonstration's camera."""
ANGLES_DEG = ((0.0, 40.0), (40.0, 70.0), (70.0, 80.0))

Average = Callable[[FloatArray, float, Pinhole], float]
"""Radiance of the patch from image (rows, columns), view angle in degrees, and camera."""


def crop(image: FloatArray, theta_r_deg: float, camera: Pinhole) -> float:
    """Return the plain mean of an image (rows, columns) over the upright box around the patch.

    The view angle is in degrees.
    """
    corners = outline(theta_r_deg, camera)
    (left, top), (right, bottom) = (
        np.rint(f(axis=0)).astype(int) for f in (corners.min, corners.max)
    )
    return float(image[top : bottom + 1, left : right + 1].mean())


def mask(image: FloatArray, theta_r_deg: float, camera: Pinhole) -> float:
    """Return the plain mean of an image (rows, columns) over pixels with their centre inside."""
    inside = np.zeros(image.shape, np.uint8)
    corners = outline(theta_r_deg, camera)
    cv2.fillConvexPoly(inside, np.rint(corners * 16).astype(np.int32), 1, shift=4)
    return float(image[inside > 0].mean())


def supersampled(image: FloatArray, theta_r_deg: float, camera: Pinhole, parts: int) -> float:
    """Return the mean of an image (rows, columns) with coverage by parts x parts points per pixel.

    Each pixel is weighted by the area of the sample that it sees.
    """
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
    """Return the program's own mean of an image (rows, columns), with exact coverage of pixels."""
    # Uncached: the cost is that of the first picture at a view angle.
    window = window_at.__wrapped__(theta_r_deg, camera, PATCH_MM, PATCH_MM)
    return window.mean(image[window.crop])


METHODS: tuple[Method[Average], ...] = (
    Method("whole pixels", "crop", crop, note="upright rectangle, plain mean"),
    Method("whole pixels", "mask", mask, note="pixels with their centre inside, plain mean"),
    *(
        Method(
            "supersampled", f"{n} × {n} points", partial(supersampled, parts=n),
            note="coverage by points, weights by area",
        )
        for n in (1, 2, 4, 8)
    ),
    Method(
        "exact", "exact coverage", coverage, default=True,
        note="coverage in closed form, weights by area",
    ),
)  # fmt: skip


def window_studies(effort: Effort) -> tuple[Study, Study]:
    """Compare by frame size over all view angles, and by view angle with the demo's camera."""
    return _by_frame(effort), _by_angle(effort)


def _by_frame(effort: Effort) -> Study:
    views = np.linspace(-78.0, 79.0, effort.frame_views)
    cameras = [_scaled(width) for width in (FRAMES_PX if effort.thorough else FRAMES_PX[:2])]
    scenes = {f"{c.width_px} × {c.height_px} pixels": (c, views) for c in cameras}
    trials = _trials("window", scenes, effort)
    return _study(
        "window",
        trials,
        title="Measuring window: how its pixels are averaged",
        caption=_frame_caption(trials, list(scenes)[1]),
        truth=f"quadrature over the patch of {PATCH_MM:g} mm; waves of {WAVE_DEPTH:.0%} on the "
        "sample; view angles to ±79°",
    )


def _by_angle(effort: Effort) -> Study:
    count, camera = max(effort.frame_views // 3, 2), shipped_camera()
    scenes = {
        f"{low:g}–{high:g}°": (camera, np.concatenate([views, -views]))
        for low, high in ANGLES_DEG
        for views in [np.linspace(low + 1, high, count)]
    }
    trials = _trials("window_angles", scenes, effort)
    return _study(
        "window_angles",
        trials,
        title="Measuring window: where whole pixels fail",
        caption=_angle_caption(trials, list(scenes)),
        truth=f"as above, {camera.width_px} × {camera.height_px} pixels, by view angle",
    )


def _study(name: str, trials: tuple[Trial, ...], *, title: str, caption: str, truth: str) -> Study:
    return Study(
        name=name, title=title, cost_axis="time per view angle (ms)",
        error_axis="bias of the radiance, worst (relative)", caption=caption, truth=truth,
        trials=trials,
    )  # fmt: skip


def _frame_caption(trials: Sequence[Trial], scene: str) -> str:
    own = {t.label: t for t in select(trials, scene=scene)}
    exact, upright, two = own["exact coverage"], own["crop"], own["2 × 2 points"]
    return (
        f"With {scene} exact coverage is off by {short(exact.error)} at the worst, and costs "
        f"{rounded(exact.cost / two.cost)} times as much as 2 × 2 points per pixel; the remaining "
        "error comes from the finite pixels, not from the method.\nAn upright crop costs "
        f"{rounded(upright.cost / exact.cost)} times as much and is off by "
        f"{short(upright.error)}: it covers another patch at every angle, and gives too much "
        "weight to the near side of the sample."
    )


def _angle_caption(trials: Sequence[Trial], scenes: Sequence[str]) -> str:
    def worst(label: str, scene: str) -> str:
        return short(select(trials, label=label, scene=scene)[0].error)

    first, last = scenes[0], scenes[-1]
    return (
        "Towards grazing the patch is narrow, and its edges are a large part of it: a crop is off "
        f"by {worst('crop', first)} at {first} and {worst('crop', last)} at {last}, a mask by "
        f"{worst('mask', first)} and {worst('mask', last)}.\nExact coverage is off by "
        f"{worst('exact coverage', first)} and {worst('exact coverage', last)}."
    )


def _scaled(width_px: int) -> Pinhole:
    """Return the demonstration's camera with pixels of another size."""
    camera = shipped_camera()
    scale = width_px / camera.width_px
    column, row = ((a + 0.5) * scale - 0.5 for a in (camera.axis_column_px, camera.axis_row_px))
    height = round(camera.height_px * scale)
    return replace(
        camera, width_px=width_px, height_px=height, axis_column_px=column, axis_row_px=row
    )


def _trials(
    study: str, scenes: dict[str, tuple[Pinhole, FloatArray]], effort: Effort
) -> tuple[Trial, ...]:
    true, trials = patch_mean(radiance, PATCH_MM), []
    for scene, (camera, views) in scenes.items():
        images = [picture(float(view), camera) for view in views]
        for method in METHODS:
            time = timed(partial(_averages, method, camera, images, views), effort.repeats)
            trials.append(method.timed_trial(study, scene, time, 1e3, time.value / true - 1))
    return tuple(trials)


def _averages(
    method: Method[Average], camera: Pinhole, images: list[FloatArray], views: FloatArray
) -> FloatArray:
    """Average at each view angle; these calls are timed together, and their bias is reported."""
    pairs = zip(images, views, strict=True)
    return np.array([method.call(image, float(view), camera) for image, view in pairs])
