"""Parts that the text formats share: facts on lines of their own, exact numbers, the table of u."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from analysis.exchange.exported import Export, fact_lines


def stated(export: Export) -> list[str]:
    """Facts and solid angles as `name: text`, each on one line."""
    table = export.table
    lines = fact_lines(export)
    for name, value in (("source", table.source_sr), ("receiver", table.receiver_sr)):
        if value is not None:
            lines.append(f"{name}_solid_angle_sr: {exact(value)}")
    return lines


def exact(value: float) -> str:
    """Shortest text that reads back as the same number."""
    return repr(float(value))


def u_table(export: Export, stem: str, name: str) -> Iterator[tuple[str, bytes]]:
    """Yield STEM.NAME.u.csv, with values and u, for the format `name` without a place for u.

    Yields nothing where no u is known. `gonio fit` reads the file if all are.
    """
    table = export.table
    if not np.any(np.isfinite(table.u_brdf)):
        return
    angles = table.geometry
    rows = zip(
        angles.theta_i_deg, angles.theta_r_deg, angles.dphi_deg, table.brdf, table.u_brdf,
        strict=True,
    )  # fmt: skip
    lines = ["theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf"]
    for *row, u in rows:
        lines.append(",".join([*map(exact, row), exact(u) if np.isfinite(u) else ""]))
    yield f"{stem}.{name}.u.csv", "\n".join([*lines, ""]).encode()
