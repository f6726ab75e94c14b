"""Command `gonio show`: pictures of a material, and what Lambert's law would cost with it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquisition.commands.fit_status import print_json
from acquisition.commands.outcomes.relative_u import parse_relative_u
from acquisition.commands.outcomes.shown_material import Found, found_material
from acquisition.terminal.console import out, print_lines, print_text
from acquisition.terminal.layout import table_lines
from acquisition.terminal.progress import sign_of_life
from analysis.rendering.light import Light, light
from analysis.rendering.photometric_stereo import Recovered
from analysis.rendering.shown.page import picture_grid, shown_html
from analysis.rendering.shown.shown import SCENES, Scene, Shown, show
from analysis.report.png import png_of
from instrument.errors import InputError
from instrument.text.atomic_file import write_whole
from instrument.text.quoting import printable
from instrument.text.text_file import parse_number

_PAGE, _PICTURE = (".html", ".htm"), ".png"
_SIZES_PX = 32, 1024
_MOST_LAMPS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """Options of the command: file to write, lamps as texts, size in pixels, noise as a text."""

    page: Path
    lamps: Sequence[str]
    size_px: int
    noise: str | None


def show_material(source: str, asked: Asked, *, as_json: bool) -> None:
    """Draw a source or a model into the file that is asked for, and print the numbers.

    Raises `InputError` for a wrong source or option, before anything is drawn.
    """
    _check(asked)
    scenes = _scenes(asked.lamps)
    noise = None if asked.noise is None else parse_relative_u(asked.noise, "--noise")
    found = found_material(source)
    with sign_of_life(f"pictures of {found.material.name}"):
        shown = show(
            found.material,
            found.origin,
            scenes=scenes,
            size=asked.size_px,
            noise=found.noise if noise is None else noise,
        )
        _write(asked.page, shown)
    if as_json:
        print_json(_json(shown))
    else:
        _print(found, shown)
        print_lines(["", f"pictures: {asked.page}"])


def _check(asked: Asked) -> None:
    if asked.page.suffix.lower() not in (*_PAGE, _PICTURE):
        raise InputError(
            f"{asked.page}: --out must end in .html for a page, or in .png for the pictures alone"
        )
    low, high = _SIZES_PX
    if not low <= asked.size_px <= high:
        raise InputError(f"--size-px: {asked.size_px}; allowed: {low} to {high} pixels")


def _scenes(texts: Sequence[str]) -> Sequence[Scene]:
    """One scene of all the lamps; those of the page by default."""
    if not texts:
        return SCENES
    if len(texts) > _MOST_LAMPS:
        raise InputError(f"--lamp: {len(texts)} lamps; allowed: up to {_MOST_LAMPS}")
    lamps, places = zip(*(_lamp(text) for text in texts), strict=True)
    named = "; ".join(places)
    return (Scene(lamps, f"lamp at {named}" if len(texts) == 1 else f"lamps at {named}"),)


def _lamp(text: str) -> tuple[Light, str]:
    """Return a lamp, and its place in words."""
    allowed = (
        "allowed: THETA or THETA,PHI in degrees: from the viewer, -90 to 90, and azimuth, 0 to the "
        "right, 90 above"
    )
    parts = text.split(",")
    try:
        angles = [parse_number(part.strip()) for part in parts]
    except ValueError as error:
        raise InputError(f"--lamp: {error}; {allowed}") from None
    if len(angles) > 2 or not -90 <= angles[0] <= 90 or not abs(angles[-1]) <= 360:
        raise InputError(f"--lamp: {printable(text)}; {allowed}")
    theta, phi = angles[0], angles[1] if len(angles) == 2 else 0.0
    return light(theta, phi), f"{theta:g}° from the viewer, azimuth {phi:g}°"


def _write(page: Path, shown: Shown) -> None:
    if page.suffix.lower() == _PICTURE:
        write_whole(page, png_of(picture_grid(shown.pictures[-1])))
    else:
        write_whole(page, shown_html(shown))


def _print(found: Found, shown: Shown) -> None:
    print_text(f"{found.material.name}: {found.origin}")
    values = [(name, f"{value:.4g}") for name, value in shown.material.parameters.items()]
    print_lines(["", *table_lines(("parameter", "value"), values, out.width), ""])
    rows = list(_rows(shown))
    print_lines([*table_lines(("", "model", "Lambert"), rows, out.width), ""])
    print_text(shown.stereo[0].sentence())


def _rows(shown: Shown) -> Iterator[tuple[str, ...]]:
    """Rows of numbers by the model and by Lambert's law."""
    yield "brightness at 60°, over the middle", *(f"{ratio:.3f}" for ratio in shown.flatness)
    yield "R² of a plane, reflectance map", *(f"{found.plane_r2:.3f}" for found in shown.maps)
    for stereo in shown.stereo:
        laws, lamps = (stereo.by_model, stereo.by_lambert), f"{stereo.lamps} lamps"
        yield f"{lamps}: normals off (rms)", *(f"{law.normals_off_deg:.1f}°" for law in laws)
        yield f"{lamps}: depth over the true", *(f"{law.depth:.2f}" for law in laws)


def _json(shown: Shown) -> dict[str, Any]:
    model, lambert = shown.flatness
    own, plane = (found.plane_r2 for found in shown.maps)
    return {
        "model": shown.material.name,
        "parameters": dict(shown.material.parameters),
        "lambert_albedo": shown.material.albedo,
        "brightness_at_60_deg": {"model": model, "lambert": lambert},
        "plane_r2": {"model": own, "lambert": plane},
        "stereo": [
            {
                "lamps": stereo.lamps,
                "noise": stereo.noise,
                "model": _recovered(stereo.by_model),
                "lambert": _recovered(stereo.by_lambert),
            }
            for stereo in shown.stereo
        ],
    }


def _recovered(found: Recovered) -> dict[str, float]:
    return {"normals_off_deg": found.normals_off_deg, "depth": found.depth}
