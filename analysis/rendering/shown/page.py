"""Page of a material: pictures of four shapes, its curves, and what Lambert's law would cost."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from analysis.rendering.photometric_stereo import REACH_DEG, Recovered
from analysis.rendering.shown import charts
from analysis.rendering.shown.shown import MAP_LAMP_DEG, Pair, Scene, Shown
from analysis.report.png import Pixels, difference_pixels, grey_pixels, image_html
from analysis.report.style import (
    CSS,
    Drawing,
    embedded_svg,
    escaped,
    figure_html,
    html_page,
    row_html,
    short_number,
    table_html,
)

_CSS = """
.shapes { display: grid; grid-template-columns: minmax(0, 8.5em) repeat(4, minmax(0, 1fr));
  gap: 8px; align-items: center; margin: 10px 0 18px; font-size: 14px; }
.shapes svg { display: block; width: 100%; height: auto; background: #000; }
.shapes b { font-weight: 600; overflow-wrap: anywhere; }
@media (max-width: 700px) { .shapes { grid-template-columns: repeat(4, minmax(0, 1fr)); }
  .shapes b { grid-column: 1 / -1; } }
"""
_LAMBERT = "Lambert’s law"


def shown_html(shown: Shown) -> str:
    """Return the page; the same material gives the same text."""
    body = [
        _head(shown),
        *(
            _scene(shown, number, scene, pictures)
            for number, (scene, pictures) in enumerate(
                zip(shown.scenes, shown.pictures, strict=True)
            )
        ),
        _sections(shown),
        _isophotes(shown),
        _maps(shown),
        _lobes(shown),
        _cost(shown),
    ]
    return html_page(f"{escaped(shown.material.name)} shown", CSS + _CSS, body)


def picture_grid(pictures: Mapping[str, Pair]) -> Pixels:
    """Return one picture, of shape (R, C, 3), 0 to 255 counts: a column for each shape.

    Its rows: the model, Lambert's law, and the difference.
    """
    white, most = _scales(pictures)
    columns = [np.concatenate(_tiles(pair, white, most), axis=0) for pair in pictures.values()]
    return np.concatenate(columns, axis=1)


def _tiles(pair: Pair, white: float, most: float) -> tuple[Pixels, Pixels, Pixels]:
    difference = difference_pixels(pair.model - pair.lambert, most)
    return grey_pixels(pair.model, white), grey_pixels(pair.lambert, white), difference


def _scales(pictures: Mapping[str, Pair]) -> tuple[float, float]:
    """Brightest of all pictures of a scene, and the largest difference, above 0."""
    pairs = pictures.values()
    white = max(float(np.nanmax([p.model, p.lambert])) for p in pairs) or 1.0
    most = max(float(np.nanmax(np.abs(p.model - p.lambert))) for p in pairs)
    return white, most or white


def _head(shown: Shown) -> str:
    units = {p.name: p.unit for p in shown.material.model.parameters}
    values = ", ".join(
        f"{name} {short_number(value, 4)} {units[name]}".removesuffix(" 1").replace(" degrees", "°")
        for name, value in shown.material.parameters.items()
    )
    model, lambert = shown.flatness
    return (
        f"<header>\n<h1>{escaped(shown.material.name)}</h1>\n"
        f'<p class="sample">{escaped(shown.origin)}</p>\n<p>{escaped(values)}. Beside it Lambert’s '
        f"law with the albedo {short_number(shown.material.albedo, 3)}.</p>\n"
        f"<p>{escaped(shown.stereo[0].sentence())} With the lamp at the viewer a vase is, where "
        f"its normal is 60° aside, {model:.2f} as bright as in its middle; by Lambert’s law "
        f"{lambert:.2f}.</p>\n</header>"
    )


def _breakable(name: str) -> str:
    """A name in HTML that may be broken between its words."""
    return escaped(name).replace("+", "+<wbr>").replace("_", "_<wbr>")


def _scene(shown: Shown, number: int, scene: Scene, pictures: Mapping[str, Pair]) -> str:
    white, most = _scales(pictures)
    rows = (shown.material.name, _LAMBERT, "difference")
    cells = []
    for row, law in enumerate(rows):
        cells.append(f"<b>{_breakable(law)}</b>")
        for shape, pair in pictures.items():
            tile = _tiles(pair, white, most)[row]
            cells.append(image_html(tile, escaped(f"{shape}: {law}")))
    caption = (
        "All on one scale of brightness, with the screen as bright as the surface (sRGB); no light "
        "goes from one place of an object to another. Difference: orange where the material is "
        f"brighter, blue where it is darker, by up to {short_number(100 * most / white, 2)} % of "
        "the brightest."
    )
    return (
        f'<h2 id="scene{number}">Pictures: {escaped(scene.words)}</h2>\n'
        f'<div class="shapes">{"".join(cells)}</div>\n<p class="soft">{caption}</p>'
    )


def _sections(shown: Shown) -> str:
    caption = (
        "Brightness across the body of the vase, as in Oren and Nayar 1995, Figure 24, where a "
        "rough clay vase is nearly as bright at its limbs as in its middle."
    )
    return _figure("section", "Brightness across the vase", charts.sections_drawing(shown), caption)


def _isophotes(shown: Shown) -> str:
    caption = (
        f"Lines of equal brightness, in steps of a tenth of the brightest, with "
        f"{escaped(shown.scenes[-1].words)}: sphere and upright cylinder."
    )
    return _figure("isophotes", "Isophotes", charts.isophotes_drawing(shown), caption)


def _maps(shown: Shown) -> str:
    theta, phi = MAP_LAMP_DEG
    caption = (
        "Brightness of a surface against its gradient, relative to the brightest; lamp "
        f"{theta:g}° from the viewer at the azimuth {phi:g}°, as in Oren and Nayar 1995, Figure "
        "25. Parallel lines at even distances are a plane, which the map of the full moon is. R²: "
        "share of the variance, within the circle, that a plane explains."
    )
    return _figure("maps", "Reflectance maps", charts.maps_drawing(shown), caption)


def _lobes(shown: Shown) -> str:
    caption = (
        "BRDF in the plane of incidence, each part of the model and their sum: distance from the "
        "middle in the direction of the view. Light comes from the right."
    )
    return _figure("lobes", "Polar lobes", charts.lobes_drawing(shown), caption)


def _cost(shown: Shown) -> str:
    rows = []
    for stereo in shown.stereo:
        cells = (
            *_recovered(stereo.by_lambert),
            *_recovered(stereo.by_model),
        )
        rows.append(row_html((f"{stereo.lamps} lamps", *cells)))
    head = (
        "", "#Lambert: normals off, rms", "#Depth found / true", "#Model: normals off, rms",
        "#Depth found / true",
    )  # fmt: skip
    two, three = shown.stereo
    text = (
        "Photometric stereo: the normal of each place from its brightness under each lamp in turn, "
        "by ratios, so that albedo and exposure need not be known; heights by summing up slopes. "
        f"Two lamps 10° to either side of the viewer on the vase’s body, as in Oren and Nayar "
        "1995, Figures 26 and 27; three lamps 10° from the viewer, all around, on the whole vase. "
        f"Normals within {REACH_DEG:g}° of the viewer count. The brightest pixel has a noise of "
        f"{short_number(100 * two.noise, 2)} %; the search with {three.lamps} lamps is by itself "
        "good to 0.4°."
    )
    table = table_html(head, rows)
    chart = _figure("", "", charts.profile_drawing(shown), "Profile as found with two lamps.")
    return (
        f'<h2 id="cost">What Lambert’s law would cost</h2>\n<p>{escaped(text)}</p>\n{table}\n'
        f"{chart}"
    )


def _recovered(found: Recovered) -> tuple[str, str]:
    return f"#{found.normals_off_deg:.1f}°", f"#{found.depth:.2f}"


def _figure(name: str, heading: str, drawing: Drawing, caption: str) -> str:
    svg = embedded_svg(drawing, name or "profile")
    head = f'<h2 id="{name}">{heading}</h2>\n' if heading else ""
    return head + figure_html([svg], heading or "profile", caption)
