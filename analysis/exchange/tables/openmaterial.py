"""OpenMATERIAL 3D: look-up table of measured BRDF, JSON, for simulations of cars' sensors.

Layout: ASAM OpenMATERIAL 3D 1.1.0, material BRDF schema: rows of wavelength in m, incident zenith,
exit zenith and exit azimuth in radians, BRDF in 1/sr from 0, sorted by their columns; the solid
angle of the receiver by wavelength. A null stands for a value that is not known. File names end in
`_brdf.xompt`.

Azimuth: relative to the incident direction, which is at 0. The discussion of its definition (issue
436 of asam-ev/OpenMATERIAL-3D) holds to the common one of BRDF, as this program's: 0 on the
source's side.
"""

from __future__ import annotations

import json
import math
import uuid
from collections.abc import Iterator
from datetime import UTC, datetime

import numpy as np

from analysis.exchange.exported import Export, fact_lines, one_line, refuse
from instrument.geometry import FloatArray

NAME = "openmaterial"
_VERSION = "1.1.0"
_WAVELENGTHS_M = (1e-9, 17.16e-3)  # allowed by the schema
_LARGEST = (1.570796, 1.570796, 6.283185)  # radians: the schema's pi/2, pi/2 and 2 pi
_UNKNOWN = "not stated"
_NOTE = (
    "Values of the look-up table are measured. In the order of its rows: the values with all "
    "digits, of which the table cannot hold negative ones (noise about zero) and has null for "
    "them, and their standard uncertainty, null where it is not known."
)


def files(export: Export, stem: str) -> Iterator[tuple[str, bytes]]:
    """Yield the look-up table, and a side file with u and with what the table cannot hold."""
    export.require_absolute(NAME)
    if not stem.endswith("_brdf"):
        refuse(NAME, "wants names that end in _brdf", f"write to {stem}_brdf.xompt")
    table, wavelength = export.table, _wavelength_m(export)
    g = table.geometry
    angles = np.radians(np.stack([g.theta_i_deg, g.theta_r_deg, g.dphi_deg], axis=1))
    angles = np.minimum(angles, _LARGEST)  # by less than 1e-6: rounded down, as in the schema
    order = np.lexsort([table.brdf, *angles.T[::-1]])
    brdf: dict[str, object] = {"wavelengths": [wavelength]}
    if table.receiver_sr is not None:
        brdf["receiverSolidAngles"] = [{"wavelength": wavelength, "solidAngle": table.receiver_sr}]
    rows = zip(angles[order].tolist(), table.brdf[order].tolist(), strict=True)
    brdf["lookupTable"] = [
        [wavelength, *angle, value if value >= 0 else None] for angle, value in rows
    ]
    yield f"{stem}.xompt", _json({"metadata": _metadata(export), "brdf": brdf})
    side = {
        "note": _NOTE,
        "brdf_per_sr": table.brdf[order].tolist(),
        "u_brdf_per_sr": _or_null(table.u_brdf[order]),
        "source_sr": table.source_sr,
        "receiver_sr": table.receiver_sr,
        "facts": {name: one_line(text) for name, text in export.facts.items()},
    }
    yield f"{stem}.json", _json(side)


def _metadata(export: Export) -> dict[str, object]:
    identity = f"gonio: {export.sample}, {one_line(export.facts.get('measurement', ''))}"
    stated: dict[str, object] = {
        "name": export.sample,
        "description": "; ".join(fact_lines(export)) or _UNKNOWN,
        "uuid": str(uuid.uuid5(uuid.NAMESPACE_OID, identity)),
        "materialVersion": "1.0.0",
        "openMaterial3dVersion": _VERSION,
        "copyrights": [_UNKNOWN],
        "license": _UNKNOWN,
        "authors": [one_line(export.facts.get("operator", "")) or _UNKNOWN],
        "sources": "measurement",
        "typicalSensorTechnology": "camera",
    }
    measured = _last_time(export)
    return stated if measured is None else {**stated, "creationDate": measured}


def _wavelength_m(export: Export) -> float:
    """Wavelength in m. Raises `InputError` if the facts have none that the format allows."""
    text = one_line(export.facts.get("wavelength_nm", ""))
    try:
        wavelength = float(text) * 1e-9
    except ValueError:
        wavelength = math.nan
    low, high = _WAVELENGTHS_M
    if not low <= wavelength <= high:
        given = f"{text} nm is not one" if text else "none is stated"
        refuse(
            NAME,
            f"lists BRDF by wavelength, from {low * 1e9:g} to {high * 1e9:g} nm, and {given}",
            "state `metadata: wavelength_nm` in the protocol of the scan, or export csv",
        )
    return wavelength


def _last_time(export: Export) -> str | None:
    """End of the measurement as YYYYMMDDTHHMMSSZ, None where the facts have no such time."""
    text = export.facts.get("measured_utc", "").split(" to ")[-1]
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        return None
    if time.tzinfo is not None:
        time = time.astimezone(UTC)
    return f"{time:%Y%m%dT%H%M%SZ}"


def _or_null(values: FloatArray) -> list[float | None]:
    return [None if math.isnan(value) else value for value in values.tolist()]


def _json(content: object) -> bytes:
    return (json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()
