"""Role of a configuration file by its keys: a rig named where a protocol is wanted, and so on."""

from __future__ import annotations

from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.config.section import Section
from instrument.text.quoting import printable

_ROLES: dict[type[Section], tuple[str, str]] = {
    Protocol: ("a protocol", "a protocol; it names its rig in a line `rig: FILE`"),
    Rig: ("a rig file", "a rig file; a protocol names it in a line `rig: FILE`"),
}
_MOST_NAMED = 4


def wrong_role(data: object, wanted: type[Section]) -> str | None:
    """Return that a file is another one than the `wanted` Protocol or Rig; None if it is one.

    A file of both kinds of keys has the role of the larger number; one without any has none.
    """
    if not isinstance(data, dict) or not data:
        return None
    counts = {role: _own(data, role) for role in _ROLES}
    role = max(_ROLES, key=lambda model: (len(counts[model]), model is wanted))
    if role is wanted and (counts[wanted] or set(data) & set(wanted.model_fields)):
        return None
    name = _ROLES[role][0] if counts[role] else f"not {_ROLES[wanted][0]}"
    keys = counts[role] or [printable(str(key)[:40]) for key in data]
    more = ", ..." if len(keys) > _MOST_NAMED else ""
    return f"is {name} (keys {', '.join(keys[:_MOST_NAMED])}{more}); allowed: {_ROLES[wanted][1]}"


def _own(data: dict[object, object], role: type[Section]) -> list[str]:
    """Keys of a file that only this role has."""
    others = {key for model in _ROLES if model is not role for key in model.model_fields}
    return [key for key in role.model_fields if key in data and key not in others]
