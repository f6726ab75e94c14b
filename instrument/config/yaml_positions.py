"""YAML as plain data, with the line and column of every key and value.

Only what all versions of YAML agree on is read, so that a file means the same in every program: a
plain word is text unless it is `true`, `false`, `null`, `~` or a decimal number such as `12`,
`-0.5` or `5.0e-3`. Text that only looks like a number (`5e-3`, `1:30`, `1_000`, `010`) stays text;
`number_hint` suggests how to write the number. Tags, anchors, aliases, merge keys and duplicate
keys are mistakes. All mistakes are collected; none is raised.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

import yaml

from instrument.text.terminal_safe import first_unfit

KeyPath = tuple[str | int, ...]

MAX_BYTES = 256 * 1024  # about 40 000 angles
MAX_DEPTH = 16  # the schema needs six
_MAX_NUMBER = 100  # characters: Python itself refuses whole numbers of more than 4300 digits

_WORDS = {"true": True, "false": False, "null": None, "~": None, "": None}
_NOT_FINITE = {".inf", "+.inf", "-.inf", ".nan"}
_WHOLE = re.compile(r"[-+]?(0|[1-9][0-9]*)")
_DECIMAL = re.compile(r"([-+]?[0-9]+\.[0-9]*|\.[0-9]+)([eE][-+][0-9]+)?")
# A number in an everyday form: 1_000, 010, 5e-3, 0,5, 12 mm, 30°.
_LOOKS = re.compile(
    r"(?P<sign>[-+]?)(?P<whole>[0-9][0-9_]*|(?=[.,][0-9]))(?:[.,](?P<part>[0-9_]*))?"
    r"(?:[eE](?P<e_sign>[-+]?)(?P<exponent>[0-9]+))?(?P<unit>\s*(?:[^\W\d_]{1,4}|[°%]))?"
)

_HINTS = {
    "cannot start any token": "indent with spaces, never with tabs; put text with % @ ` in quotes",
    "mapping values are not allowed": "one colon too many, or a wrong indent; text with ': ' needs"
    " quotes",
    "could not find expected ':'": "each line of a block is `key: value`",
    "but found '<block": "the indent differs from that of the lines above",
    "expected ',' or": "a comma or a closing bracket is missing",
}


class Mark(NamedTuple):
    """Position in a text: line and column, both from 1."""

    line: int
    column: int


@dataclass(frozen=True, slots=True)
class Mistake:
    """Mistake in the YAML itself, with its position."""

    mark: Mark
    path: KeyPath
    text: str


@dataclass(slots=True)
class MarkedYaml:
    """Data of a YAML text, with positions and mistakes.

    `values` and `keys`: position of each value and of its key, by path. `refused`: paths whose
    value was not accepted and is None in `data`. `readable`: False if the text could not be read at
    all, so that `data` is empty.
    """

    text: str = ""
    data: dict[str, object] = field(default_factory=dict)
    values: dict[KeyPath, Mark] = field(default_factory=dict)
    keys: dict[KeyPath, Mark] = field(default_factory=dict)
    refused: set[KeyPath] = field(default_factory=set)
    mistakes: list[Mistake] = field(default_factory=list)
    readable: bool = False

    def add(self, mark: Mark, path: KeyPath, text: str) -> None:
        """Add a mistake."""
        self.mistakes.append(Mistake(mark, path, text))

    def get(self, path: KeyPath) -> object:
        """Return the value at `path`, None if there is none."""
        value: object = self.data
        for key in path:
            if isinstance(value, dict):
                value = value.get(key)
            elif isinstance(value, list) and isinstance(key, int) and 0 <= key < len(value):
                value = value[key]
            else:
                return None
        return value

    def mark(self, path: KeyPath) -> Mark:
        """Return the position of the value at `path`, or of the innermost block around it."""
        while path and path not in self.values:
            path = path[:-1]
        return self.values.get(path, Mark(1, 1))


def place(file: Path, text: str, at: KeyPath) -> str:
    """Return `file:line:column: path` of a value in a text that has been read before."""
    mark = read_yaml(text.encode()).mark(at)
    return f"{file}:{mark.line}:{mark.column}: {dotted(at)}"


def read_yaml(raw: bytes) -> MarkedYaml:
    """Read one YAML document, a block of keys; mistakes are in the result, none is raised."""
    found = MarkedYaml()
    if len(raw) > MAX_BYTES:
        found.add(Mark(1, 1), (), f"the file is too large; allowed: {MAX_BYTES // 1024} kB")
        return found
    try:
        found.text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = raw[: error.start].decode("utf-8-sig")
        found.add(
            _mark_of(before, len(before)),
            (),
            f"byte 0x{raw[error.start]:02x} is not UTF-8 text; save the file as UTF-8",
        )
        return found
    _Reader(found).read()
    return found


def plain_value(text: str) -> object:
    """Return the value of a plain (unquoted) word: a boolean, None, an int, a float or the text."""
    if text in _WORDS:
        return _WORDS[text]
    if text in _NOT_FINITE:
        return float(text.replace(".", ""))
    if len(text) > _MAX_NUMBER:
        return text
    if _WHOLE.fullmatch(text):
        return int(text)
    return float(text) if _DECIMAL.fullmatch(text) else text


def number_hint(text: str, *, whole: bool = False, unit_in_key: bool = True) -> str | None:
    """Return advice on how to write the number that `text` seems to mean; None if it is none.

    unit_in_key: the name of the key ends with a unit; one without takes a fraction for per cent.
    """
    text = text.strip()
    if len(text) > _MAX_NUMBER:
        return None
    if is_number(plain_value(text)):
        return f"write {text}, without quotes"
    if re.fullmatch(r"[-+]?[0-9]+(:[0-9]+)+(\.[0-9]*)?", text):
        return "write one number, in the unit that the key names, without a colon"
    if re.fullmatch(r"[-+]?0([xX][0-9a-fA-F]+|[oO][0-7]+|[bB][01]+)", text):
        return f"write {int(text, 0)}"
    number = _LOOKS.fullmatch(text)
    return None if number is None else _without_unit(number, whole, unit_in_key)


def _without_unit(number: re.Match[str], whole: bool, unit_in_key: bool) -> str:
    value, unit = _decimal(number), (number["unit"] or "").strip()
    if unit == "%":
        fraction = f"{Decimal(value) / 100:f}"
        return "write it in the unit of the key" if unit_in_key else f"write {fraction}, not in %"
    if whole and float(value).is_integer() and len(value) < 20:
        value = f"{float(value):.0f}"
    in_key = ": the unit is in the key's name" if unit_in_key else f", without {unit}"
    return f"write {value}{in_key if unit else ''}"


def _decimal(number: re.Match[str]) -> str:
    whole = number["whole"].replace("_", "").lstrip("0") or "0"
    part, exponent = number["part"], number["exponent"]
    text = f"-{whole}" if number["sign"] == "-" else whole
    if part is not None or exponent is not None:
        text += f".{(part or '').replace('_', '') or '0'}"
    return text if exponent is None else f"{text}e{number['e_sign'] or '+'}{exponent}"


class _TooDeepError(Exception):
    def __init__(self, mark: Mark, path: KeyPath) -> None:
        super().__init__()
        self.mark, self.path = mark, path


class _Reader:
    """Converter of the parser's events to data; recursive, at most MAX_DEPTH levels."""

    def __init__(self, found: MarkedYaml) -> None:
        self.found = found
        self.last = Mark(1, 1)
        self.events: Iterator[yaml.Event] = iter(())

    def read(self) -> None:
        found = self.found
        try:
            self.events = iter(yaml.parse(found.text, Loader=yaml.SafeLoader))
            data = self._document()
        except yaml.reader.ReaderError as error:
            text = f"character {error.character!r} is not allowed; remove it"
            found.add(_mark_of(found.text, error.position), (), text)
        except yaml.MarkedYAMLError as error:
            found.add(*_syntax(error))
        except _TooDeepError as error:
            text = f"nested too deeply; allowed: {MAX_DEPTH} levels"
            found.add(error.mark, error.path[:4], text)
        except (ValueError, OverflowError):
            # The parser raises these for an escape or a version number beyond Python's range.
            found.add(self.last, (), "YAML cannot be read from here on: a number is too large")
        else:
            self._take(data)

    def _take(self, data: object) -> None:
        if isinstance(data, dict):
            self.found.data, self.found.readable = data, True
        elif () not in self.found.refused:
            what = "the file is empty" if data is None else f"the file is {kind_of(data)}"
            text = f"{what}; allowed: a block of `key: value` lines"
            self.found.add(self.found.mark(()), (), text)

    def _next(self) -> yaml.Event:
        event = next(self.events)
        self.last = _mark(event)
        return event

    def _document(self) -> object:
        self._next()
        if isinstance(self._next(), yaml.StreamEndEvent):
            return None
        data = self._value(self._next(), ())
        self._next()
        if isinstance(self._next(), yaml.DocumentStartEvent):
            self.found.add(self.last, (), "a second document begins; allowed: one per file")
        return data

    def _value(self, event: yaml.Event, path: KeyPath) -> object:
        mark = self.found.values[path] = _mark(event)
        self._refuse_extras(event, path)
        if isinstance(event, yaml.AliasEvent):
            text = f"alias *{str(event.anchor)[:40]} is not supported; write the value itself"
            self.found.add(mark, path, text)
            self.found.refused.add(path)
            return None
        if isinstance(event, yaml.ScalarEvent):
            return plain_value(event.value) if event.style is None else event.value
        if len(path) >= MAX_DEPTH:
            raise _TooDeepError(mark, path)
        return self._list(path) if isinstance(event, yaml.SequenceStartEvent) else self._map(path)

    def _list(self, path: KeyPath) -> list[object]:
        items: list[object] = []
        while not isinstance(event := self._next(), yaml.SequenceEndEvent):
            items.append(self._value(event, (*path, len(items))))
        return items

    def _map(self, path: KeyPath) -> dict[str, object]:
        block: dict[str, object] = {}
        while not isinstance(event := self._next(), yaml.MappingEndEvent):
            key = self._key(event, path)
            if key is None:
                self._skip(self._next(), path)
            else:
                block[key] = self._value(self._next(), (*path, key))
        return block

    def _key(self, event: yaml.Event, path: KeyPath) -> str | None:
        """Return the key as text, or None, with a mistake added, if it is not accepted."""
        mark = _mark(event)
        if not isinstance(event, yaml.ScalarEvent):
            self.found.add(mark, path, "a key must be one word, not a block, a list or an alias")
            self._skip(event, path)
            return None
        key: str = event.value
        self._refuse_extras(event, (*path, key))
        if key == "<<" and event.style is None:
            self.found.add(mark, path, "merge key << is not supported; write the keys themselves")
            return None
        first = self.found.keys.setdefault((*path, key), mark)
        if first is not mark:
            text = f"duplicate key, first at line {first.line}, column {first.column}"
            self.found.add(mark, (*path, key), f"{text}; keep one of them")
            return None
        return key

    def _skip(self, event: yaml.Event, path: KeyPath) -> None:
        depth = 0
        while True:
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth == 0:
                return
            if depth > MAX_DEPTH:
                raise _TooDeepError(self.last, path)
            event = self._next()

    def _refuse_extras(self, event: yaml.Event, path: KeyPath) -> None:
        tag = getattr(event, "tag", None)
        if tag is not None:
            self.found.add(
                _mark(event), path, f"tag {tag[:40]!r} is not supported; write the plain value"
            )
            self.found.refused.add(path)
        anchor = getattr(event, "anchor", None)
        if anchor is not None and not isinstance(event, yaml.AliasEvent):
            self.found.add(_mark(event), path, f"anchor &{anchor[:40]} is not supported; remove it")
        text = getattr(event, "value", "")
        unfit = first_unfit(text)
        if unfit is not None:
            # An escape such as "\ud800" gives text that no file can hold, "\x1b[2J" a command to
            # the terminal that displays it.
            half = "half a character" if "\ud800" <= unfit <= "\udfff" else "a control character"
            what = f"{text[:40]!r} holds {half} ({repr(unfit)[1:-1]})"
            self.found.add(_mark(event), path, f"{what}; remove it")
            self.found.refused.add(path)


def is_number(value: object) -> bool:
    """Return True for a number; true and false are not numbers."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def kind_of(value: object) -> str:
    """Return the kind of a value from YAML in words, with its article."""
    if value is None:
        return "nothing"
    for kind, words in (
        (bool, "a true/false value"),
        (int | float, "a number"),
        (str, "text"),
        (list, "a list"),
    ):
        if isinstance(value, kind):
            return words
    return "a block of keys"


def dotted(path: KeyPath) -> str:
    """Return a path as `sweeps[0].theta_r_deg.num`, with unusual keys in quotes."""
    text = ""
    for key in path:
        if isinstance(key, int):
            text += f"[{key}]"
        else:
            plain = key[:40] if key.isidentifier() else repr(key[:40])
            text += f".{plain}" if text else plain
    return text


def _mark(event: yaml.Event) -> Mark:
    place = event.start_mark
    return Mark(1, 1) if place is None else Mark(place.line + 1, place.column + 1)


def _mark_of(text: str, position: int) -> Mark:
    before = text[:position]
    return Mark(before.count("\n") + 1, position - before.rfind("\n"))


def _syntax(error: yaml.MarkedYAMLError) -> tuple[Mark, KeyPath, str]:
    place = error.problem_mark or error.context_mark
    mark = Mark(place.line + 1, place.column + 1) if place is not None else Mark(1, 1)
    problem = error.problem or error.context or "unknown reason"
    text = f"YAML cannot be read here: {problem}"
    if error.context and error.context_mark:
        text += f", {error.context} that begins at line {error.context_mark.line + 1}"
    hint = next((words for part, words in _HINTS.items() if part in problem), None)
    return mark, (), f"{text} ({hint})" if hint else text
