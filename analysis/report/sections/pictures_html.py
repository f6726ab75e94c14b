"""Camera pictures of a report, with the window of averaged pixels."""

from __future__ import annotations

import base64
import math
import struct

from analysis.report.style import escaped
from instrument.record.reading import Preview

_PNG_HEADER = struct.Struct(">8s4x4sII")


def pictures_html(previews: tuple[Preview, ...]) -> str:
    """Return the contact sheet; empty without a picture."""
    if not previews:
        return ""
    return (
        '<h2 id="pictures">Camera pictures</h2>\n'
        '<p class="soft">Outline: the window of averaged pixels, which shows the same area of the '
        'sample at every angle.</p>\n<div class="pictures">'
        + "".join(map(_picture, previews))
        + "</div>"
    )


def _picture(preview: Preview) -> str:
    caption = f"<figcaption>{escaped(preview.caption)}</figcaption>"
    size = _png_size(preview.png)
    if size is None:
        return f"<figure><p>This picture cannot be read.</p>{caption}</figure>"
    # Whole numbers are the centres of pixels in the record, and their edges in SVG.
    corners = " ".join(
        f"{x + 0.5:.2f},{y + 0.5:.2f}"
        for x, y in preview.polygon
        if math.isfinite(x) and math.isfinite(y)
    )
    outline = f'<polygon points="{corners}" fill="none" vector-effect="non-scaling-stroke"'
    png = base64.b64encode(preview.png).decode("ascii")
    return (
        f'<figure><svg viewBox="0 0 {size[0]} {size[1]}" role="img" aria-label="camera picture">'
        f'<image width="{size[0]}" height="{size[1]}" href="data:image/png;base64,{png}"/>'
        f'{outline} stroke="#000" stroke-width="4"/>{outline} stroke="#fff" stroke-width="1.8"/>'
        f"</svg>{caption}</figure>"
    )


def _png_size(png: bytes) -> tuple[int, int] | None:
    """Width and height in pixels from the header of a PNG; None for other data."""
    if len(png) < _PNG_HEADER.size:
        return None
    signature, chunk, width, height = _PNG_HEADER.unpack_from(png)
    known = signature == b"\x89PNG\r\n\x1a\n" and chunk == b"IHDR" and width and height
    return (width, height) if known else None
