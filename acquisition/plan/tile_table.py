"""Check of a plan against the table of the white tile: it must have the angles of each reading."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from acquisition.plan.pose import Pose
from instrument.calibration.tile_table import OutsideTable
from instrument.config.load import Loaded
from instrument.config.yaml_positions import place


def outside_table(readings: Sequence[Pose], loaded: Loaded) -> Iterator[str]:
    """Yield one line for each way in which readings of the tile lie outside its table."""
    tile = loaded.protocol.references.white_tile
    if tile is None or tile.values is None:
        return
    at = place(loaded.protocol_path, loaded.protocol_text, ("references", "white_tile", "table"))
    found: dict[str, int] = {}
    for pose in dict.fromkeys(readings):
        try:
            tile.values.at(pose.theta_i, pose.theta_r, pose.dphi)
        except OutsideTable as error:
            found[str(error)] = found.get(str(error), 0) + 1
    for text, count in found.items():
        more = f" (at {count} settings of the lamp)" if count > 1 else ""
        yield (
            f"{at}: {tile.table} has no value for the reading of the tile at {text}{more}; "
            "allowed: angles inside the table: change sweeps or white_tile.theta_r_deg, or have "
            "the tile calibrated there"
        )
