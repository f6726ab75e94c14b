"""White tiles of tests: tables as a certificate states them, and protocols that name one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from instrument.calibration.tile_file import read_tile_table
from instrument.config.load import Loaded
from instrument.config.protocol import WhiteTile
from instrument.config.rig import SimulatedTile
from instrument.geometry import Geometry
from sim.defects.tile import radiance_factor
from tests.support.scans import changed

SPECTRALON = SimulatedTile(at_normal=1.057, falloff=0.18, forward=0.5)
"""Like sintered PTFE: see `SimulatedTile`."""


def table_text(
    true: SimulatedTile,
    u: float,
    u_common: float,
    random: np.random.Generator | None = None,
    common: float | None = None,
) -> str:
    """A certificate of a tile seen at 10 deg, each 15 deg of theta_i, with drawn errors of its u.

    `u`: of each value by itself, `u_common`: of an error of them all, which is `common` of its u,
    or drawn.
    """
    drawn = random or np.random.default_rng(0)
    scale = u_common * drawn.standard_normal() if random else 0.0
    scale = scale if common is None else u_common * common
    lines = ["theta_i_deg,theta_r_deg,dphi_deg,beta,u_beta,u_beta_common"]
    for theta_i in np.arange(0.0, 76.0, 15.0):
        for dphi in (0.0, 180.0):
            angles = Geometry.from_degrees(theta_i=theta_i, theta_r=10.0, dphi=dphi)
            beta = float(radiance_factor(angles, true)) + scale
            beta += u * drawn.standard_normal() if random else 0.0
            lines.append(f"{theta_i:g},10,{dphi:g},{beta!r},{u!r},{u_common!r}")
    return "\n".join(lines) + "\n"


def tabled(text: str, folder: Path, **keys: float) -> WhiteTile:
    """A tile seen at 10 deg, with the text of a table, which is written into `folder`."""
    path = folder / "tile.csv"
    path.write_text(text)
    tile = WhiteTile(table=path.name, theta_r_deg=10.0, frames=4)
    return tile.model_copy(update=keys).with_values(read_tile_table(path))


def with_tile(loaded: Loaded, tile: WhiteTile, true: SimulatedTile | None = None) -> Loaded:
    """The configuration with another tile in the protocol, and perhaps a true one in the rig."""
    references = loaded.protocol.references.model_copy(update={"white_tile": tile})
    simulation = loaded.rig.simulation.model_copy(update={"tile": true})
    rig = {} if true is None else {"simulation": simulation}
    return changed(loaded, rig=rig, references=references)
