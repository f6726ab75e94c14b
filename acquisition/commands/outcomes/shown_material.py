"""Material that `gonio show` draws: of a run, a fit, a table, or a model with parameters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.design.assumed_sample import AssumedSample, sample_of_fit, sample_of_text
from acquisition.results.facts.rendered_material import (
    ASSUMED_NOISE,
    camera_noise,
    material_of,
)
from acquisition.results.run_folder import load_run_inputs
from acquisition.results.sources import Wanted, read_source
from acquisition.terminal.progress import sign_of_life
from analysis.choice.choice import choose
from analysis.rendering.cross_section import across
from analysis.rendering.light import HEADLIGHT
from analysis.rendering.material import Material
from instrument.errors import InputError, NotDetermined
from instrument.record.record import FILE_NAME, Record
from instrument.text.quoting import printable

_COMMAND = "gonio show"


@dataclass(frozen=True, slots=True)
class Found:
    """Material, where it comes from in words, and the relative u of a picture's brightest pixel."""

    material: Material
    origin: str
    noise: float


def found_material(source: str) -> Found:
    """Return the material of a run's folder, a fit.json, a table, or MODEL:NAME=VALUE,NAME=VALUE.

    A run is shown as its fit.json says, or fitted where it has none; a table is fitted. Raises
    `InputError` for another source, and for a material that reflects nothing; `NotDetermined` where
    no model could be fitted.
    """
    path = Path(source)
    if path.exists():
        found = _of_path(path)
    elif "/" in source or path.suffix in (".json", ".csv"):
        raise InputError(f"{_COMMAND}: {printable(source)}: is not there")
    else:
        sample = sample_of_text(source, _COMMAND, defaults=True)
        found = Found(_material(sample), "a model with given parameters", ASSUMED_NOISE)
    if not np.max(across(found.material, [HEADLIGHT], np.linspace(-80, 80, 17))) > 0:
        raise InputError(f"{_COMMAND}: {printable(source)}: reflects nothing that could be shown")
    return found


def _of_path(path: Path) -> Found:
    is_run = (path / FILE_NAME).is_file()
    noise = _noise(path) if is_run else ASSUMED_NOISE
    if path.suffix == ".json" or (path / "fit.json").is_file():
        sample = sample_of_fit(path, _COMMAND)
        return Found(_material(sample), f"fitted: {sample.source}", noise)
    with sign_of_life(f"fit of {path.name}"):
        read = read_source(path, Wanted())
        best = choose(read.measurements, read.acceptance, read.fit.models).best
    if best is None:
        raise NotDetermined(f"{path}: no model could be fitted: there is nothing to show")
    return Found(material_of(best), f"fitted to {printable(str(path))}", noise)


def _noise(run: Path) -> float:
    with Record.open(run) as record:
        return camera_noise(load_run_inputs(record))


def _material(sample: AssumedSample) -> Material:
    named = zip(sample.model.parameters, sample.x, strict=True)
    return Material(sample.model, {p.name: float(v) for p, v in named}, sample.model.name)
