"""Tables of other programs, recognised by their content, as measurements."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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


def read_foreign(files: Sequence[TextFile], kind: str, *, repeats: bool = False) -> Measurements:
    """Read texts in the format `kind` as one table.

    theta_r is signed, with dphi from 0 to 180 degrees. Without `repeats`, each direction may stand
    in it once. Raises `InputError` for every mistake.
    """
    tables = [READERS[kind].read(file) for file in files]
    angles = [
        np.concatenate([getattr(table.geometry, name) for table in tables])
        for name in ("theta_i_deg", "theta_r_deg", "dphi_deg")
    ]
    theta_i, theta_r, dphi = _signed(*angles)
    file = files[0]
    if not repeats:
        _refuse_repeats(file, np.stack([theta_i, theta_r, dphi], axis=1))
    u_brdf = _u_brdf(file, np.concatenate([table.u_brdf for table in tables]))
    brdf = np.concatenate([table.brdf for table in tables])
    return Measurements.bare(theta_i, theta_r, dphi, brdf, u_brdf)


def _signed(
    theta_i: FloatArray, theta_r: FloatArray, dphi: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angles (N,) in degrees with dphi from 0 to 180 and the sign on theta_r."""
    azimuth = np.mod(np.round(dphi, 9), 360.0)
    far = azimuth >= 180
    return theta_i, np.where(far, -1, 1) * theta_r, azimuth - np.where(far, 180.0, 0.0)


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


def _u_brdf(file: TextFile, u_brdf: FloatArray) -> FloatArray | None:
    """Standard uncertainties (N,) in 1/sr, None where none is known."""
    known = np.isfinite(u_brdf)
    if not np.any(known):
        return None
    if not np.all(known):
        raise InputError(
            f"{file.name}: u is 0 or missing for {int(np.sum(~known))} of {known.size} values; "
            "allowed: a u for all values or for none"
        )
    return u_brdf
