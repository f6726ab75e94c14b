"""Section of a report with pictures of the fitted material, and what Lambert's law would cost."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from analysis.report.data import Rendered
from analysis.report.png import difference_pixels, grey_pixels, image_html
from analysis.report.style import escaped, short_number
from instrument.geometry import FloatArray

_WIDE, _HIGH = 100.0, 100.0  # of the picture of profiles, in its own units
_MARGIN = 8.0


def rendered_html(make: Callable[[], Rendered | None] | None) -> str:
    """Return the section; empty without pictures, as where no model was fitted."""
    rendered = None if make is None else make()
    return "" if rendered is None else _section(rendered)


def _section(rendered: Rendered) -> str:
    white = float(np.nanmax([np.nanmax(rendered.model), np.nanmax(rendered.lambert)]))
    difference = rendered.model - rendered.lambert
    most = float(np.nanmax(np.abs(difference)))
    scale = most or white
    name = escaped(rendered.name)
    tiles = (
        (image_html(grey_pixels(rendered.model, white), f"sphere, {name}"), name),
        (
            image_html(grey_pixels(rendered.lambert, white), "sphere, Lambert's law"),
            f"Lambert’s law, albedo {short_number(rendered.albedo, 3)}",
        ),
        (
            image_html(difference_pixels(difference, scale), "difference of the two spheres"),
            "difference: orange where the material is brighter, blue where it is darker, by up to "
            f"{short_number(100 * most / white, 2)} % of white",
        ),
        (_profiles(rendered), f"{escaped(rendered.shape)}: white the true one, {_LINES}"),
    )
    figures = "".join(
        f"<figure>{picture}<figcaption>{caption}</figcaption></figure>"
        for picture, caption in tiles
    )
    return (
        f'<h2 id="rendered">Pictures of the material</h2>\n<p>{escaped(rendered.cost)}</p>\n'
        f'<p class="soft">{escaped(rendered.scene)}</p>\n'
        f'<div class="pictures rendered">{figures}</div>'
    )


_LINES = "orange by Lambert’s law, blue by this model"


def _profiles(rendered: Rendered) -> str:
    """Profiles as found and the true one, on equal scales, each with its foot at the left."""
    curves = (
        (rendered.lambert_heights, "#F09A55", "1.2"),
        (rendered.model_heights, "#56B4E9", "1.2"),
        (rendered.heights, "#FFFFFF", "0.7"),
    )
    x, every = rendered.places, np.concatenate([y for y, *_ in curves])
    scale = (_WIDE - 2 * _MARGIN) / float(max(np.ptp(x), np.ptp(every)))
    middle = float(every.max() + every.min()) / 2
    lines = "".join(
        f'<polyline points="{_points(scale * (x - x[0]), scale * (y - middle))}" fill="none" '
        f'stroke="{colour}" stroke-width="{width}"/>'
        for y, colour, width in curves
    )
    return (
        f'<svg viewBox="0 0 {_WIDE:g} {_HIGH:g}" role="img" aria-label="profiles as found">'
        f"{lines}</svg>"
    )


def _points(x: FloatArray, y: FloatArray) -> str:
    return " ".join(f"{_MARGIN + a:.1f},{_HIGH / 2 - b:.1f}" for a, b in zip(x, y, strict=True))
