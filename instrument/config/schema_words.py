"""Explanation of pydantic's errors in plain words: what is given, what is allowed, what to write.

pydantic names the place and the kind of an error; the JSON schema of the model says what is allowed
there, and the YAML data what was written.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from pydantic import ValidationError

from instrument.config.protocol import FORMS_OF_ANGLES
from instrument.config.section import Section
from instrument.config.yaml_positions import (
    KeyPath,
    Mark,
    MarkedYaml,
    is_number,
    kind_of,
    number_hint,
    plain_value,
)
from instrument.text.quoting import shown


class Explanation:
    """Mistakes of a file in plain words, `found` as path, text and, for keys, the position."""

    def __init__(self, error: ValidationError, model: type[Section], marked: MarkedYaml) -> None:
        self.found: list[tuple[KeyPath, str, Mark | None]] = []
        self._marked, self._root = marked, _json_schema(model)
        self._misspelt: set[KeyPath] = set()
        missing = list(self._missing_axes())
        for item in error.errors(include_url=False):
            path = _path(item["loc"], marked.data, item["type"])
            if not any(path[:depth] in marked.refused for depth in range(len(path) + 1)):
                missing += self._explain(path, item["type"], item)
        for path in missing:
            # A misspelt key has been reported as such.
            if path not in self._misspelt and path not in marked.keys:
                self._add(path, f"is missing; allowed: {self._words(self._node(path))}")

    def _add(self, path: KeyPath, text: str, mark: Mark | None = None) -> None:
        self.found.append((path, text, mark))

    def _explain(self, path: KeyPath, kind: str, item: Mapping[str, Any]) -> list[KeyPath]:
        """Add one mistake; of missing keys, return the paths instead."""
        if kind == "missing":
            return [path]
        if kind in ("union_tag_invalid", "union_tag_not_found"):
            return self._wrong_member(path)
        if kind == "extra_forbidden" or item["loc"][-1:] == ("[key]",):
            self._unknown_key(path)
        elif kind == "together":
            for key, text in item["ctx"]["found"]:
                if (*path, key) not in self._marked.refused:  # which is reported as such
                    self._add((*path, key), text)
        elif kind != "too_short" or not isinstance(item["input"], dict):
            self._wrong_value(path, kind)
        return []

    def _missing_axes(self) -> Iterator[KeyPath]:
        """Yield axes that a sweep lacks, which pydantic reports only if the others are valid."""
        sweeps = self._marked.get(("sweeps",))
        for k, sweep in enumerate(sweeps if isinstance(sweeps, list) else []):
            if sweep == {}:
                text = "an empty sweep; allowed: "
                self._add(("sweeps", k), text + self._words(self._node(("sweeps", k))))
            elif isinstance(sweep, dict):
                yield from (("sweeps", k, key) for key in self._keys(("sweeps", k)))

    def _unknown_key(self, path: KeyPath) -> None:
        allowed = self._keys(path[:-1])
        near = difflib.get_close_matches(str(path[-1]), allowed, n=1)
        self._misspelt |= {(*path[:-1], key) for key in near}
        meant = f"did you mean {near[0]}? " if near else ""
        text = f"unknown key; {meant}allowed: {', '.join(allowed)}"
        self._add(path, text, self._marked.keys.get(path))

    def _wrong_member(self, path: KeyPath) -> list[KeyPath]:
        """Add the mistake of a block whose driver is unknown; return the path of a missing one."""
        if not isinstance(self._marked.get(path), dict):
            self._wrong_value(path, "type")
            return []
        path = (*path, "driver")
        if path in self._marked.keys:
            self._wrong_value(path, "literal_error")
        return [path]

    def _wrong_value(self, path: KeyPath, kind: str) -> None:
        value, node = self._marked.get(path), self._node(path)
        hint = _hint(value, self._options(node), path)
        text = f"{_given(value, kind)}; allowed: {self._words(node)}"
        self._add(path, f"{text} ({hint})" if hint else text)

    def _node(self, path: KeyPath) -> dict[str, Any]:
        node = self._root
        for depth, key in enumerate(path):
            node = self._member(node, self._marked.get(path[:depth]))
            if key == "driver" and "oneOf" in node:
                return {"enum": list(node["discriminator"]["mapping"])}
            if isinstance(key, int):
                node = node.get("items", {})
            else:
                rest = node.get("additionalProperties") or {}
                node = node.get("properties", {}).get(key, rest)
        return node

    def _keys(self, path: KeyPath) -> list[str]:
        node = self._member(self._node(path), self._marked.get(path))
        return list(node.get("properties") or node.get("propertyNames", {}).get("enum", []))

    def _resolve(self, node: dict[str, Any]) -> dict[str, Any]:
        name = node.get("$ref", "").rpartition("/")[2]
        return self._root["$defs"][name] if name else node

    def _options(self, node: dict[str, Any]) -> list[dict[str, Any]]:
        options = [self._resolve(n) for n in node.get("anyOf") or node.get("oneOf") or [node]]
        return [n for n in options if n.get("type") != "null"]

    def _member(self, node: dict[str, Any], value: object) -> dict[str, Any]:
        """Return the member of a union that the value belongs to; the union itself if undecided."""
        if "discriminator" in node:
            driver = value.get("driver") if isinstance(value, dict) else None
            drivers = node["discriminator"]["mapping"]
            known = isinstance(driver, str) and driver in drivers
            return self._resolve({"$ref": drivers[driver]}) if known else node
        options = self._options(node)
        form = "array" if isinstance(value, list) else "object"
        return next((n for n in options if n.get("type") == form), options[0])

    def _words(self, node: dict[str, Any]) -> str:
        if "discriminator" in node:
            return f"a block with driver: {' or '.join(node['discriminator']['mapping'])}"
        return " or ".join(self._one(option) for option in self._options(node))

    def _one(self, node: dict[str, Any], *, many: bool = False) -> str:
        if "enum" in node or "const" in node:
            return " or ".join(str(value) for value in node.get("enum", [node.get("const")]))
        kind = node.get("type")
        if kind == "array":
            count = f"{node['maxItems']} " if "maxItems" in node else ""
            return f"a list of {count}{self._one(self._resolve(node['items']), many=True)}"
        if kind == "object":
            keys = node.get("properties") or node.get("propertyNames", {}).get("enum")
            one = "blocks" if many else "a block"
            return one + (f" with {', '.join(keys)}" if keys else " of names and numbers")
        if kind == "string":
            length = f" of 1 to {node['maxLength']} characters" if "maxLength" in node else ""
            return str(node.get("description", ("texts" if many else "text") + length))
        if kind == "boolean":
            return "true or false"
        number = "whole number" if kind == "integer" else "number"
        return (f"{number}s" if many else f"a {number}") + _range(node)


@cache
def _json_schema(model: type[Section]) -> dict[str, Any]:
    return model.model_json_schema()


_TOO = {
    "greater_than": "is too small",
    "greater_than_equal": "is too small",
    "less_than": "is too large",
    "less_than_equal": "is too large",
    "finite_number": "is not finite",
    "string_too_short": "is empty",
    "string_too_long": "is too long",
    "too_short": "is too short",
    "too_long": "is too long",
    "literal_error": "is none of these",
    "string_pattern_mismatch": "has more than one line, or another form",
}


_UNITS = ("_deg", "_mm", "_um", "_nm", "_s", "_sr", "_px")  # at the end of a key
# Words for true and false in YAML 1.1 and elsewhere.
_TRUTH = dict.fromkeys(("true", "yes", "y", "on", "1"), "true")
_TRUTH |= dict.fromkeys(("false", "no", "n", "off", "0"), "false")


def _range(node: Mapping[str, Any]) -> str:
    low, high = node.get("minimum"), node.get("maximum")
    above, below = node.get("exclusiveMinimum"), node.get("exclusiveMaximum")
    if low is not None and high is not None:
        return f" from {low} to {high}"
    limits = {"at least": low, "greater than": above, "at most": high, "less than": below}
    bounds = [f"{word} {bound}" for word, bound in limits.items() if bound is not None]
    return f", {' and '.join(bounds)}" if bounds else ""


def _given(value: object, kind: str) -> str:
    if kind in _TOO:
        return f"{shown(value)} {_TOO[kind]}"
    if value is None or isinstance(value, list | dict):
        return f"{kind_of(value)} is given"
    if isinstance(value, float) and kind == "int_type":
        return f"{shown(value)} is not a whole number"
    # Many programs read 5e-3 as a number, but YAML 1.1 does not.
    rule = isinstance(value, str) and value == plain_value(value) and number_hint(value)
    return f"{shown(value)} is {kind_of(value)}{' by the rules of YAML' if rule else ''}"


def _hint(value: object, options: list[dict[str, Any]], path: KeyPath) -> str | None:
    """Return advice on what to write instead, if the value suggests any."""
    forms = {node.get("type"): node for node in options}
    if "number" in forms or "integer" in forms:
        unit_in_key = any(str(key).endswith(_UNITS) for key in path)
        return _number_instead(value, whole="number" not in forms, unit_in_key=unit_in_key)
    if "boolean" in forms:
        word = _TRUTH.get(str(value).strip().lower())
        return f"write {word}" if word else None
    if "array" in forms:
        item = forms["array"]["items"].get("type")
        fits = is_number(value) if item == "number" else isinstance(value, str) and item == "string"
        return f"write [{shown(value)}]" if fits else None
    if isinstance(value, str):
        near = difflib.get_close_matches(value, options[0].get("enum", []), n=1)
        return f"did you mean {near[0]}?" if near else None
    is_word = isinstance(value, bool) or is_number(value)
    return f"write '{shown(value)}', in quotes" if "string" in forms and is_word else None


def _number_instead(value: object, *, whole: bool, unit_in_key: bool) -> str | None:
    if isinstance(value, str):
        return number_hint(value, whole=whole, unit_in_key=unit_in_key)
    if whole and isinstance(value, float) and value.is_integer():
        return f"write {value:.0f}"
    return None


def _path(loc: tuple[str | int, ...], data: object, kind: str) -> KeyPath:
    """Return pydantic's path without the names of the members of unions."""
    path: list[str | int] = []
    value = data
    for k, key in enumerate(loc):
        own_key = kind == "extra_forbidden" and k == len(loc) - 1
        if key == "[key]" or (_is_member(key, value) and not own_key):
            continue
        path.append(key)
        if isinstance(value, dict):
            value = value.get(key)
        elif isinstance(value, list) and isinstance(key, int):
            value = value[key]
    return tuple(path)


def _is_member(key: str | int, value: object) -> bool:
    driver = value.get("driver") if isinstance(value, dict) else None
    return key in FORMS_OF_ANGLES or (key == driver and key != "driver")
