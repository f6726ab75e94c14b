"""Tables of other programs, recognised by their content, as measurements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from analysis.data.measurements import Measurements
from analysis.exchange.dense import zemax_reader
from analysis.exchange.exported import BrdfTable
from analysis.exchange.tables import alta, astm, pab
from instrument.errors import InputError
from instrument.geometry import FloatArray
from instrument.text.text_file import TextFile


class Reader(NamedTuple):
    """Reader of a format: a test of a text's header, and its table; `InputError` for mistakes."""

    recognises: Callable[[TextFile], bool]
    read: Callable[[TextFile], BrdfTable]


READERS: Mapping[str, Reader] = MappingProxyType(
    {
        "astm": Reader(astm.is_astm, astm.read),
        "zemax": Reader(zemax_reader.is_zemax, zemax_reader.read_zemax),
        "pab": Reader(pab.is_pab, pab.read),
        "alta": Reader(alta.is_alta, alta.read),
    }
)


def kind_of(file: TextFile) -> str | None:
    """Name of the format among READERS, None for a text of another kind."""
    return next((name for name, reader in READERS.items() if reader.recognises(file)), None)


def read_foreign(file: TextFile, kind: str, *, repeats: bool = False) -> Measurements:
    """Read a text in the format `kind`; theta_r is signed, with dphi from 0 to 180 degrees.

    Without `repeats`, each direction may stand in it once. Raises `InputError` for every mistake.
    """
    table = READERS[kind].read(file)
    angles = table.geometry
    azimuth = np.mod(np.round(angles.dphi_deg, 9), 360.0)
    far = azimuth >= 180
    theta_r, dphi = np.where(far, -1, 1) * angles.theta_r_deg, azimuth - np.where(far, 180.0, 0.0)
    if not repeats:
        _refuse_repeats(file, np.stack([angles.theta_i_deg, theta_r, dphi], axis=1))
    u_brdf = _u_brdf(file, table)
    return Measurements.bare(angles.theta_i_deg, theta_r, dphi, table.brdf, u_brdf)


def _refuse_repeats(file: TextFile, angles: FloatArray) -> None:
    """Raise `InputError` if rows of angles (N, 3) in degrees are the same."""
    rows, counts = np.unique(angles, axis=0, return_counts=True)
    if np.any(counts > 1):
        theta_i, theta_r, dphi = rows[np.argmax(counts)]
        raise InputError(
            f"{file.name}: {int(np.sum(counts > 1))} directions stand in it more than once, as "
            f"theta_i {theta_i:g}, theta_r {theta_r:g}, dphi {dphi:g} degrees; allowed: each once; "
            "average repeats: --repeats mean"
        )


def _u_brdf(file: TextFile, table: BrdfTable) -> FloatArray | None:
    """Standard uncertainties (N,) in 1/sr, None where none is known."""
    known = np.isfinite(table.u_brdf)
    if not np.any(known):
        return None
    if not np.all(known):
        raise InputError(
            f"{file.name}: u is 0 or missing for {int(np.sum(~known))} of {table.size} values; "
            "allowed: a u for all values or for none"
        )
    return table.u_brdf
