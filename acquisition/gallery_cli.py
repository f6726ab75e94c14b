"""Command `gonio gallery`: the papers' figures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def gallery(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the page, new or empty.")],
) -> None:
    """Draw the figures of the four papers with the models, and check what the papers state.

    One page, index.html: every figure that needs no photograph and no measurement, by its number.
    """
    from acquisition.commands.papers.gallery import draw_gallery

    draw_gallery(out)
