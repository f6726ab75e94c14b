"""Sample that a scan is planned for: a model with values, from the protocol, an option or a fit."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.results.model_check import check_model
from analysis.models import MODELS, Model
from instrument.config.load import Loaded
from instrument.errors import InputError
from instrument.geometry import FloatArray
from instrument.text.atomic_file import read_file
from instrument.text.quoting import printable

_FIT = "fit.json"
_MOST_BYTES = 50_000_000  # of a fit.json
_FORM = "MODEL:NAME=VALUE,NAME=VALUE, a run's folder, or a fit.json"


@dataclass(frozen=True, slots=True)
class AssumedSample:
    """Model and parameters (K,), in the model's order and units; `source` in words."""

    model: Model
    x: FloatArray
    source: str

    @property
    def text(self) -> str:
        """The model and its values in words."""
        named = zip(self.model.parameters, self.x, strict=True)
        values = ", ".join(f"{p.name} {value:g}" for p, value in named)
        return f"{self.model.name} with {values} ({self.source})"


def assumed_sample(like: str | None, loaded: Loaded) -> AssumedSample:
    """Return the sample that `like` describes; without it the protocol's simulated one.

    Raises `InputError` for a text that describes none, and where there is neither.
    """
    if like is None:
        return _of_protocol(loaded)
    path = Path(like)
    if path.is_dir() or path.suffix == ".json":
        return sample_of_fit(path, "--like")
    return sample_of_text(like, "--like")


def _of_protocol(loaded: Loaded) -> AssumedSample:
    sample = loaded.protocol.simulated_sample
    if sample is None:
        raise InputError(
            f"{loaded.protocol_path}: no simulated_sample to plan for; allowed: --like {_FORM} of "
            "a sample like the one to be measured"
        )
    return _sample(sample.model, sample.parameters, "simulated_sample of the protocol")


def sample_of_text(like: str, option: str, *, defaults: bool = False) -> AssumedSample:
    """Return the sample that a text MODEL:NAME=VALUE,NAME=VALUE describes.

    option: opens the message of an error. defaults: parameters may be left out. Raises `InputError`
    for another text.
    """
    name, _, rest = like.partition(":")
    values: dict[str, float] = {}
    for part in filter(None, rest.split(",")):
        key, equals, number = part.partition("=")
        try:
            values[key.strip()] = float(number)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"{option}: {printable(part)}; allowed: NAME=NUMBER, as in {_FORM}")
    if defaults and check_model(name, None) is None:
        values = {**{p.name: p.default for p in MODELS[name].parameters}, **values}
    wrong = check_model(name, values)
    if wrong is not None:
        raise InputError(f"{option} {printable(like)}: {wrong}; the form is {_FORM}")
    return _sample(name, values, option)


def sample_of_fit(path: Path, option: str) -> AssumedSample:
    """Return the chosen model of a fit: of the folder of a run, or of a fit.json.

    option: opens the message of an error. Raises `InputError` where there is none.
    """
    path = path / _FIT if path.is_dir() else path
    try:
        data = json.loads(read_file(path, _MOST_BYTES))
        chosen = data["chosen"]
        found = next(c for c in data["candidates"] if c["model"] == chosen)
        values = {str(k): _number(v["value"]) for k, v in found["parameters"].items()}
    except OSError as error:
        raise InputError(f"{option}: {path}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError, AttributeError, StopIteration):
        raise InputError(
            f"{option}: {path}: holds no chosen model; allowed: a fit.json of gonio run, report or "
            "fit, whose fit has found one"
        ) from None
    name = str(chosen)
    known = {p.name for p in MODELS[name].parameters} if check_model(name, None) is None else ()
    values = {key: value for key, value in values.items() if key in known}  # no factor of its own
    wrong = check_model(name, values)
    if wrong is not None:
        raise InputError(f"{option}: {path}: {printable(wrong)}")
    return _sample(name, values, printable(str(path)))


def _number(value: Any) -> float:
    return float(value)


def _sample(name: str, values: dict[str, float], source: str) -> AssumedSample:
    model = MODELS[name]
    return AssumedSample(model, np.array([float(values[p.name]) for p in model.parameters]), source)
