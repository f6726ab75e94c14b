"""The bytes of a YAML file; where there is none, what its folder holds instead."""

from __future__ import annotations

import difflib
from pathlib import Path

from instrument.config.yaml_positions import MAX_BYTES
from instrument.errors import InputError
from instrument.text.atomic_file import read_file
from instrument.text.quoting import printable


def yaml_bytes(path: Path) -> bytes:
    """What it holds, up to one byte past MAX_BYTES. Raises `InputError` with what is near."""
    try:
        return read_file(path, MAX_BYTES)
    except FileNotFoundError:
        problem = f"no such file; {_near(path)}"
    except IsADirectoryError:
        problem = f"is a folder; allowed: a YAML file; {_near(path / 'x.yaml')}"
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        problem = f"cannot be read: {reason}; check its name and permissions"
    raise InputError(f"{printable(str(path))}: {problem}")


def _near(path: Path) -> str:
    """Files in the folder of a missing one, those of a similar name if there are such."""
    try:
        names = sorted(p.name for p in path.parent.iterdir() if p.is_file())
    except OSError:
        return f"there is no folder {printable(str(path.parent))} to be read either"
    yaml_names = [name for name in names if name.endswith((".yaml", ".yml"))]
    stems = {name.rpartition(".")[0]: name for name in yaml_names}
    close = [stems[stem] for stem in difflib.get_close_matches(path.stem, stems, n=3)]
    there = ", ".join(map(printable, close or yaml_names[:8])) or "no YAML file"
    return f"in {printable(str(path.parent))} there is {there}"
