"""Text of a protocol with chosen geometries: the given file with other sweeps."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from instrument.config.load import Loaded
from instrument.config.yaml_positions import read_yaml


def protocol_text(
    chosen: Loaded,
    folder: Path,
    comments: Sequence[str],
    *,
    name: str | None = None,
    more: Mapping[str, object] | None = None,
) -> str:
    """Return the text of a file in `folder`: the protocol as read, with the sweeps of `chosen`.

    Paths of the rig and of a table of the white tile lead to the same files. Comments of the file
    are lost; `comments` open it. name: of the protocol, by default its own with `_optimal`. more:
    further entries, in place of its own.
    """
    data: dict[str, Any] = dict(read_yaml(chosen.protocol_text.encode()).data)
    data |= more or {}
    data["name"] = name or f"{chosen.protocol.name}_optimal"
    data["rig"] = _path_from(folder, chosen.rig_path)
    tile = chosen.protocol.references.white_tile
    if tile is not None and tile.table is not None:
        table = _path_from(folder, chosen.protocol_path.parent / tile.table)
        references = data["references"]
        data["references"] = {
            **references,
            "white_tile": {**references["white_tile"], "table": table},
        }
    data["sweeps"] = [dict(sweep) for sweep in chosen.protocol.sweeps]
    opening = "".join(f"# {_in_one_line(line)}\n" for line in comments)
    body = yaml.safe_dump(
        data, sort_keys=False, default_flow_style=None, allow_unicode=True, width=100
    )
    return opening + body


def _path_from(folder: Path, file: Path) -> str:
    return os.path.relpath(file.resolve(), folder.resolve())


def _in_one_line(text: str) -> str:
    """Return a text, perhaps a file's name, that ends no comment."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)
