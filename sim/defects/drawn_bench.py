"""Bench drawn from a seed: the sizes of all defects anew, with the spreads their keys state."""

from __future__ import annotations

import zlib
from typing import TypeVar

import numpy as np

from instrument.config.rig import Rig
from instrument.config.section import Section
from instrument.config.simulated.spread import Spread

S = TypeVar("S", bound=Section)

_LIMIT = 2.0  # standard deviations


def drawn_bench(rig: Rig) -> Rig:
    """Return the rig with the sizes of its defects drawn from its seed, if it asks for that.

    Each size has a random stream of its own, keyed by its name: one more defect in the file changes
    no other. Sizes of 0 stay 0. Raises `ValueError` for a size beyond what its key allows.
    """
    simulation = rig.simulation
    if not simulation.drawn:
        return rig
    drawn = _drawn(simulation, simulation.seed, "simulation")
    return rig.model_copy(update={"simulation": drawn.model_copy(update={"drawn": False})})


def _drawn(section: S, seed: int, path: str) -> S:
    values = {}
    for name, field in type(section).model_fields.items():
        value, key = getattr(section, name), f"{path}.{name}"
        spreads = [mark for mark in field.metadata if isinstance(mark, Spread)]
        if isinstance(value, Section):
            value = _drawn(value, seed, key)
        elif spreads:
            stream = np.random.default_rng([seed, zlib.crc32(key.encode())])
            value = _size(value, spreads[0], stream)
        values[name] = value
    return type(section).model_validate(values)


def _size(size: float, spread: Spread, random: np.random.Generator) -> float:
    if spread is Spread.SIZE:
        return float(size * random.uniform(0.5, 1.5))
    while abs(deviation := float(random.standard_normal())) > _LIMIT:
        pass
    return size * deviation
