"""Values of devices in the form of bluesky's documents: readings with a time, keys with a unit."""

from __future__ import annotations

from collections.abc import Mapping

Value = float | int | str
ReadingDict = dict[str, Value]
"""One value with its time in seconds of the Unix epoch: `{"value": ..., "timestamp": ...}`."""
KeyDict = dict[str, object]
"""Description of one value: source, dtype, shape, dtype_numpy and, where it has one, units."""

_UNITS = {  # by the end of a name; the longer ones first
    "_deg_per_s2": "deg/s^2",
    "_deg_per_s": "deg/s",
    "_relative": "1",
    "_pixels": "px",
    "_deg": "deg",
    "_dn": "DN",
    "_mm": "mm",
    "_nm": "nm",
    "_sr": "sr",
    "_s": "s",
    "brdf": "1/sr",
    "radiance": "DN/s",
}


def units_of(name: str) -> str | None:
    """Return the unit that the end of a name states, None for a name without one."""
    return next((unit for end, unit in _UNITS.items() if name.endswith(end)), None)


def reading(value: Value, time_s: float) -> ReadingDict:
    """Return one reading; time_s: seconds of the Unix epoch."""
    return {"value": value, "timestamp": time_s}


def readings(values: Mapping[str, Value], time_s: float) -> dict[str, ReadingDict]:
    """Return readings of values by name, taken together; time_s: seconds of the Unix epoch."""
    return {name: reading(value, time_s) for name, value in values.items()}


def data_keys(values: Mapping[str, Value], source: str) -> dict[str, KeyDict]:
    """Return the descriptions of values by name, each with the unit that its name states."""
    return {name: data_key(name, type(value), source) for name, value in values.items()}


def data_key(name: str, kind: type, source: str, units: str | None = None) -> KeyDict:
    """Return the description of a value whose type is `kind`: float, int or str."""
    dtype, numpy = _DTYPES[kind]
    key: KeyDict = {"source": source, "dtype": dtype, "shape": [], "dtype_numpy": numpy}
    unit = units or units_of(name)
    return key if kind is str or unit is None else key | {"units": unit}


_DTYPES: Mapping[type, tuple[str, str]] = {
    float: ("number", "<f8"),
    int: ("integer", "<i8"),
    str: ("string", "<U0"),  # of any length
}
