"""Reading of a YAML file; the error for a missing one suggests similar names."""

from __future__ import annotations

import difflib
from pathlib import Path

from instrument.config.yaml_positions import MAX_BYTES
from instrument.errors import InputError
from instrument.text.atomic_file import read_file
from instrument.text.file_kind import foreign_kind
from instrument.text.quoting import printable


def yaml_bytes(path: Path) -> bytes:
    """Return the bytes of a file, at most one more than MAX_BYTES. Raises `InputError`."""
    try:
        raw = read_file(path, MAX_BYTES)
        kind = foreign_kind(raw)
        if kind is None:
            return raw
        allowed = f"allowed: a YAML file; {_suggestion(path)}"
        raise InputError(f"{printable(str(path))}:1:1: is {kind.name}; {allowed}")
    except FileNotFoundError:
        problem = f"no such file; {_suggestion(path)}"
    except IsADirectoryError:
        problem = f"is a folder; allowed: a YAML file; {_suggestion(path / 'x.yaml')}"
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        problem = f"cannot be read: {reason}; check its name and permissions"
    raise InputError(f"{printable(str(path))}: {problem}")


def _suggestion(path: Path) -> str:
    """Return the YAML files beside a missing one, only those of a similar name if there are any."""
    try:
        names = sorted(p.name for p in path.parent.iterdir() if p.is_file())
    except OSError:
        return f"there is no readable folder {printable(str(path.parent))} either"
    yaml_names = [name for name in names if name.endswith((".yaml", ".yml"))]
    stems = {name.rpartition(".")[0]: name for name in yaml_names}
    close = [stems[stem] for stem in difflib.get_close_matches(path.stem, stems, n=3)]
    there = ", ".join(map(printable, close or yaml_names[:8])) or "no YAML file"
    return f"in {printable(str(path.parent))} there is {there}"
