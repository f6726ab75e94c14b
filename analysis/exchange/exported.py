"""Content of an export: measured values, the model fitted to them, and facts about both."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NoReturn

from instrument.errors import InputError
from instrument.geometry import FloatArray, Geometry


@dataclass(frozen=True, slots=True, kw_only=True)
class BrdfTable:
    """Measured BRDF in the angles of `instrument/geometry.py`, N points in the order measured.

    geometry: (N,), theta_r from 0 to 90 degrees and dphi from 0 to 360 degrees. brdf: (N,) in 1/sr;
    negative values are data: noise about zero. u_brdf: (N,) in 1/sr, standard uncertainty, NaN
    where it is not known. relative: without a reference, `brdf` is in a unit of its own.
    source_sr, receiver_sr: solid angles of lamp and lens as seen from the sample, in sr, None where
    they are not known.
    """

    geometry: Geometry
    brdf: FloatArray
    u_brdf: FloatArray
    relative: bool = False
    source_sr: float | None = None
    receiver_sr: float | None = None

    @property
    def size(self) -> int:
        """Number of points."""
        return int(self.brdf.size)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedModel:
    """Model that was chosen for the values.

    name: as `gonio models` lists it, terms joined by `+`. verdict: that of the choice. values and
    u: by parameter name in the parameters' units; u None where it is not determined. brdf: returns
    the BRDF in 1/sr of a geometry, in its shape.
    """

    name: str
    verdict: str
    values: Mapping[str, float]
    u: Mapping[str, float | None]
    brdf: Callable[[Geometry], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class Export:
    """Content that a format may write.

    facts: about sample and measurement, as texts by name, in the order in which they are written;
    `sample` is among them. own_table: text of the program's own table, as measurements.csv. model:
    None where there is none, for the reason `no_model`.
    """

    table: BrdfTable
    own_table: str
    facts: Mapping[str, str] = field(default_factory=dict)
    model: ExportedModel | None = None
    no_model: str = "no model was fitted"

    @property
    def sample(self) -> str:
        """Name of the sample on one line, `sample` where it has none."""
        return one_line(self.facts.get("sample", "")) or "sample"

    def require_absolute(self, name: str) -> None:
        """Raise `InputError` if the values have no absolute scale; `name`: that of the format."""
        if self.table.relative:
            refuse(
                name,
                "holds BRDF in 1/sr, and these values are relative: measured without a white tile",
                "measure with a white tile, or export as csv or nexus",
            )

    def require_model(self, name: str) -> ExportedModel:
        """Return the model; raise `InputError` if there is none."""
        if self.model is None:
            refuse(name, f"describes a fitted model, and {self.no_model}", "export measured values")
        return self.model


def refuse(name: str, why: str, advice: str) -> NoReturn:
    """Raise `InputError` for content that a format cannot hold."""
    raise InputError(f"--format {name}: the format {why}; {advice}")


def fact_lines(export: Export) -> list[str]:
    """Facts as `name: text`, each on one line."""
    return [f"{name}: {one_line(text)}" for name, text in export.facts.items()]


def one_line(text: str) -> str:
    """Text in one line, without characters that cannot be printed, which break most formats."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
