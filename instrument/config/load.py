"""Loading of rig and protocol files, with every mistake reported at once and with its position.

Each mistake is one line: `file:line:column: path: value; allowed: what (advice)`. Values that are
valid by themselves are checked against each other even if others are not.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from instrument.config.protocol import (
    FORMS_OF_ANGLES,
    ModelCheck,
    Protocol,
    own_mistakes,
    rig_mistakes,
)
from instrument.config.rig import Rig
from instrument.config.section import Section
from instrument.config.yaml_file import yaml_bytes
from instrument.config.yaml_positions import (
    KeyPath,
    Mark,
    MarkedYaml,
    dotted,
    is_number,
    kind_of,
    number_hint,
    plain_value,
    read_yaml,
)
from instrument.errors import InputError
from instrument.text.quoting import printable, shown

MAX_REPORTED = 200  # mistakes per file; more would scroll the first ones off the screen

AnySection = TypeVar("AnySection", bound=Section)


@dataclass(frozen=True, slots=True)
class Loaded:
    """Valid protocol and rig that fit each other, with the texts of their files."""

    protocol: Protocol
    protocol_path: Path
    protocol_text: str
    rig: Rig
    rig_path: Path
    rig_text: str


def load_rig(path: Path) -> Rig:
    """Read a rig file. Raises `InputError` with every mistake in it."""
    file = _File(path, read_yaml(yaml_bytes(path)))
    rig = file.check(Rig)
    if rig is None or file.found:
        raise InputError(*_report(file))
    return rig


def load_protocol(
    path: Path, rig_path: Path | None = None, *, check_model: ModelCheck | None = None
) -> Loaded:
    """Read a protocol and its rig; `rig_path` replaces the rig that the protocol names.

    `check_model(name, parameters)` returns what is wrong with a model of the protocol, or None;
    parameters are None if the protocol only names the model. Raises `InputError` with every mistake
    in either file and between them.
    """
    file = _File(path, read_yaml(yaml_bytes(path)))
    protocol = file.check(Protocol)
    for at, text in own_mistakes(file.marked, check_model):
        file.add(at, text)
    rig_file = _rig_file(file, rig_path)
    rig = None if rig_file is None else rig_file.check(Rig)
    if rig_file is not None and file.marked.readable and rig_file.marked.readable:
        for at, text in rig_mistakes(file.marked, rig_file.marked, rig_file.name):
            file.add(at, text)
    files = [file] if rig_file is None else [file, rig_file]
    if protocol is None or rig is None or rig_file is None or any(f.found for f in files):
        raise InputError(*_report(*files))
    return Loaded(protocol, path, file.marked.text, rig, rig_file.path, rig_file.marked.text)


def _rig_file(protocol: _File, rig_path: Path | None) -> _File | None:
    """Return the rig's file, or None, with a mistake added, if the named one cannot be read."""
    if rig_path is not None:
        try:
            return _File(rig_path, read_yaml(yaml_bytes(rig_path)))
        except InputError as error:
            raise InputError(*_report(protocol), *error.problems) from None
    named = protocol.marked.get(("rig",))
    if not isinstance(named, str) or not named or ("rig",) in protocol.marked.refused:
        return None
    path = protocol.path.parent / named
    plain = Path(os.path.normpath(path))
    try:
        # After a linked folder, ".." is not the folder that it seems to be.
        path = plain if plain.exists() or not path.exists() else path
        return _File(path, read_yaml(yaml_bytes(path)))
    except InputError as error:
        protocol.add(("rig",), error.problems[0])
    except (OSError, ValueError):
        protocol.add(("rig",), f"{named!r}; allowed: the path of a rig file")
    return None


def _report(*files: _File) -> list[str]:
    """Return the mistakes of all files, each once, ordered by file and position."""
    lines = []
    for file in sorted(files, key=lambda f: f.name):
        found = sorted(set(file.found), key=lambda item: (item[0], item[1]))
        lines += [f"{file.name}:{m.line}:{m.column}: {text}" for m, text in found[:MAX_REPORTED]]
        if len(found) > MAX_REPORTED:
            mark = found[MAX_REPORTED][0]
            more = f"{len(found) - MAX_REPORTED} more mistakes from here on"
            lines.append(f"{file.name}:{mark.line}:{mark.column}: {more}")
    return lines


@dataclass(slots=True)
class _File:
    """Configuration file under check, with the mistakes found so far."""

    path: Path
    marked: MarkedYaml
    found: list[tuple[Mark, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for mistake in self.marked.mistakes:
            self.add(mistake.path, mistake.text, mistake.mark)

    @property
    def name(self) -> str:
        return printable(str(self.path))

    def add(self, path: KeyPath, text: str, mark: Mark | None = None) -> None:
        """Add a mistake; by default at the value, or at the block that lacks it."""
        where = f"{dotted(path)}: " if path else ""
        self.found.append((mark or self.marked.mark(path), where + text))

    def check(self, model: type[AnySection]) -> AnySection | None:
        """Return the file as a model, or None, with the mistakes added, if it is not valid."""
        if not self.marked.readable:
            return None
        try:
            return model.model_validate(self.marked.data)
        except ValidationError as error:
            _Schema(self, model).explain(error)
            return None


class _Schema:
    """Explanation of pydantic's errors in plain words, from the JSON schema of a model."""

    def __init__(self, file: _File, model: type[Section]) -> None:
        self.file, self.marked = file, file.marked
        self.root = _json_schema(model)
        self.misspelt: set[KeyPath] = set()

    def explain(self, error: ValidationError) -> None:
        """Add a mistake for each error of pydantic, at its position."""
        missing = list(self._missing_axes())
        for item in error.errors(include_url=False):
            path = _path(item["loc"], self.marked.data, item["type"])
            if not any(path[:depth] in self.marked.refused for depth in range(len(path) + 1)):
                missing += self._note(path, item["type"], item)
        for path in missing:
            # A misspelt key has been reported as such.
            if path not in self.misspelt and path not in self.marked.keys:
                self.file.add(path, f"is missing; allowed: {self._words(self._node(path))}")

    def _note(self, path: KeyPath, kind: str, item: Mapping[str, Any]) -> list[KeyPath]:
        """Add one mistake; of missing keys, return the paths instead."""
        if kind == "missing":
            return [path]
        if kind in ("union_tag_invalid", "union_tag_not_found"):
            return self._no_form(path)
        if kind == "extra_forbidden" or item["loc"][-1:] == ("[key]",):
            self._unknown_key(path)
        elif kind == "together":
            for key, text in item["ctx"]["found"]:
                self.file.add((*path, key), text)
        elif kind != "too_short" or not isinstance(item["input"], dict):
            self._wrong_value(path, kind)
        return []

    def _missing_axes(self) -> Iterator[KeyPath]:
        """Yield axes that a sweep lacks, which pydantic reports only if the others are valid."""
        sweeps = self.marked.get(("sweeps",))
        for k, sweep in enumerate(sweeps if isinstance(sweeps, list) else []):
            if sweep == {}:
                text = "an empty sweep; allowed: "
                self.file.add(("sweeps", k), text + self._words(self._node(("sweeps", k))))
            elif isinstance(sweep, dict):
                yield from (("sweeps", k, key) for key in self._keys(("sweeps", k)))

    def _unknown_key(self, path: KeyPath) -> None:
        allowed = self._keys(path[:-1])
        near = difflib.get_close_matches(str(path[-1]), allowed, n=1)
        self.misspelt |= {(*path[:-1], key) for key in near}
        meant = f"did you mean {near[0]}? " if near else ""
        text = f"unknown key; {meant}allowed: {', '.join(allowed)}"
        self.file.add(path, text, self.marked.keys.get(path))

    def _no_form(self, path: KeyPath) -> list[KeyPath]:
        """Add the mistake of a block whose driver is unknown; return the path of a missing one."""
        if not isinstance(self.marked.get(path), dict):
            self._wrong_value(path, "type")
            return []
        path = (*path, "driver")
        if path in self.marked.keys:
            self._wrong_value(path, "literal_error")
        return [path]

    def _wrong_value(self, path: KeyPath, kind: str) -> None:
        value, node = self.marked.get(path), self._node(path)
        hint = _hint(value, self._options(node))
        text = f"{_what_stands(value, kind)}; allowed: {self._words(node)}"
        self.file.add(path, f"{text} ({hint})" if hint else text)

    def _node(self, path: KeyPath) -> dict[str, Any]:
        node = self.root
        for depth, key in enumerate(path):
            node = self._form(node, self.marked.get(path[:depth]))
            if key == "driver" and "oneOf" in node:
                return {"enum": list(node["discriminator"]["mapping"])}
            if isinstance(key, int):
                node = node.get("items", {})
            else:
                rest = node.get("additionalProperties") or {}
                node = node.get("properties", {}).get(key, rest)
        return node

    def _keys(self, path: KeyPath) -> list[str]:
        node = self._form(self._node(path), self.marked.get(path))
        return list(node.get("properties") or node.get("propertyNames", {}).get("enum", []))

    def _resolve(self, node: dict[str, Any]) -> dict[str, Any]:
        name = node.get("$ref", "").rpartition("/")[2]
        return self.root["$defs"][name] if name else node

    def _options(self, node: dict[str, Any]) -> list[dict[str, Any]]:
        options = [self._resolve(n) for n in node.get("anyOf") or node.get("oneOf") or [node]]
        return [n for n in options if n.get("type") != "null"]

    def _form(self, node: dict[str, Any], value: object) -> dict[str, Any]:
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
        if kind == "string" and "description" in node:
            return str(node["description"])
        if kind == "string":
            length = f" of 1 to {node['maxLength']} characters" if "maxLength" in node else ""
            return ("texts" if many else "text") + length
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


def _range(node: Mapping[str, Any]) -> str:
    low, high = node.get("minimum"), node.get("maximum")
    above, below = node.get("exclusiveMinimum"), node.get("exclusiveMaximum")
    if low is not None and high is not None:
        return f" from {low} to {high}"
    limits = {"at least": low, "greater than": above, "at most": high, "less than": below}
    bounds = [f"{word} {bound}" for word, bound in limits.items() if bound is not None]
    return f", {' and '.join(bounds)}" if bounds else ""


def _what_stands(value: object, kind: str) -> str:
    if kind in _TOO:
        return f"{shown(value)} {_TOO[kind]}"
    if value is None or isinstance(value, list | dict):
        return f"{kind_of(value)} is given"
    if isinstance(value, float) and kind == "int_type":
        return f"{shown(value)} is not a whole number"
    # Many programs read 5e-3 as a number, but YAML 1.1 does not.
    rule = isinstance(value, str) and value == plain_value(value) and number_hint(value)
    return f"{shown(value)} is {kind_of(value)}{' by the rules of YAML' if rule else ''}"


def _hint(value: object, options: list[dict[str, Any]]) -> str | None:
    """Return advice on what to write instead, if the value suggests any."""
    forms = {node.get("type"): node for node in options}
    if "number" in forms or "integer" in forms:
        return _number_instead(value, whole="number" not in forms)
    if "array" in forms:
        item = forms["array"]["items"].get("type")
        fits = is_number(value) if item == "number" else isinstance(value, str) and item == "string"
        return f"write [{shown(value)}]" if fits else None
    if isinstance(value, str):
        near = difflib.get_close_matches(value, options[0].get("enum", []), n=1)
        return f"did you mean {near[0]}?" if near else None
    is_word = isinstance(value, bool) or is_number(value)
    return f"write '{shown(value)}', in quotes" if "string" in forms and is_word else None


def _number_instead(value: object, *, whole: bool) -> str | None:
    if isinstance(value, str):
        return number_hint(value, whole=whole)
    if whole and isinstance(value, float) and value.is_integer():
        return f"write {value:.0f}"
    return None


def _path(loc: tuple[str | int, ...], data: object, kind: str) -> KeyPath:
    """Return pydantic's path without the names of the members of unions."""
    path: list[str | int] = []
    value = data
    for k, key in enumerate(loc):
        own_key = kind == "extra_forbidden" and k == len(loc) - 1
        if key == "[key]" or (_is_form(key, value) and not own_key):
            continue
        path.append(key)
        if isinstance(value, dict):
            value = value.get(key)
        elif isinstance(value, list) and isinstance(key, int):
            value = value[key]
    return tuple(path)


def _is_form(key: str | int, value: object) -> bool:
    driver = value.get("driver") if isinstance(value, dict) else None
    return key in FORMS_OF_ANGLES or (key == driver and key != "driver")
