"""Formats of `gonio export`, by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

from analysis.exchange.dense import merl, nexus, zemax
from analysis.exchange.exported import Export
from analysis.exchange.materials import mitsuba, radiance
from analysis.exchange.tables import alta, astm, openmaterial, pab


class Format(NamedTuple):
    """Format of a file.

    suffix: of its file name. about: what it holds and who reads it, in a few words. files: yields
    name and content of each file that an export consists of, the main one first; it raises
    `InputError` for what the format cannot hold, before anything is written. holds_flagged: points
    with a flag are in it too, with their flags.
    """

    suffix: str
    about: str
    files: Callable[[Export, str], Iterator[tuple[str, bytes]]]
    holds_flagged: bool = False


def _own_table(export: Export, stem: str) -> Iterator[tuple[str, bytes]]:
    yield f"{stem}.csv", export.own_table.encode()


FORMATS: Mapping[str, Format] = MappingProxyType(
    {
        "csv": Format(".csv", "all that was measured, as measurements.csv", _own_table, True),
        "nexus": Format(".nxs", "NeXus/HDF5, for NeXpy and h5web", nexus.files),
        "merl": Format(".binary", "the model on the MERL grid, for renderers", merl.files),
        "astm": Format(".astm", "ASTM E1392 text, for libbsdf and others", astm.files),
        "zemax": Format(".bsdf", "Zemax tabular BSDF, for OpticStudio", zemax.files),
        "pab": Format(".pab", "pab-opto text, for pabopto2bsdf of Radiance", pab.files),
        "alta": Format(".alta", "ALTA text with error bars, for fits by ALTA", alta.files),
        "mitsuba": Format(".xml", "material of Mitsuba 3: the model", mitsuba.files),
        "radiance": Format(".rad", "material of Radiance: the model", radiance.files),
        "openmaterial": Format(
            ".xompt", "OpenMATERIAL 3D, for simulated car sensors", openmaterial.files
        ),
    }
)
