"""Summary of a camera's calibration: a table for a person, and JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator

from acquisition.calibration.result import rig_file_values
from acquisition.terminal.layout import table_lines, wrapped
from instrument.calibration.camera_calibration import CameraCalibration
from instrument.calibration.quantity import Quantity
from instrument.config.rig import Rig


def summary_lines(calibration: CameraCalibration, rig: Rig, width: int) -> Iterator[str]:
    """Yield the lines of the summary for a terminal of this width."""
    yield from wrapped(f"calibration of {calibration.camera}, {calibration.date_utc}", width)
    stated = rig_file_values(rig)
    yield from quantity_lines(calibration.quantities, stated, width)
    yield ""
    yield from wrapped(response_text(calibration), width)


def quantity_lines(
    quantities: dict[str, Quantity], stated: dict[str, float], width: int
) -> list[str]:
    """Return quantities as a table, beside what the rig file states by the same key."""
    rows = [_row(quantity, stated.get(key)) for key, quantity in quantities.items()]
    return table_lines(("quantity", "symbol", "value", "rig file"), rows, width)


def quantities_json(quantities: dict[str, Quantity]) -> dict[str, object]:
    """Return quantities as JSON takes them."""
    return {
        key: {"value": q.value, "u": q.u, "unit": q.unit, "symbol": q.symbol, "name": q.name}
        for key, q in quantities.items()
    }


def response_text(calibration: CameraCalibration) -> str:
    """Return the response in words."""
    curve, u = calibration.curve, 100 * calibration.u_light_relative
    span = calibration.max_dn - calibration.black_dn
    low, high = (
        100 * (counts - calibration.black_dn) / span
        for counts in (calibration.low_dn, calibration.high_dn)
    )
    words = f"response, from {low:.2g} to {high:.2g} % of full scale: {curve.name}"
    bend = calibration.quantities["nonlinearity_percent"].value
    if curve.parameters and not curve.is_video:
        words += f", counts per light vary by {bend:.2g} %"
    return f"{words}; u of light from counts by its inverse: {u:.2g} %"


def summary_json(calibration: CameraCalibration, file: str) -> dict[str, object]:
    """Return the calibration as JSON takes it, without pixel maps."""
    return {
        "file": file,
        "sha256": calibration.sha256,
        "camera": calibration.camera,
        "settings": calibration.settings,
        "rig": calibration.rig,
        "date_utc": calibration.date_utc,
        "quantities": quantities_json(calibration.quantities),
        "response": {
            "name": calibration.curve.name,
            "kind": calibration.curve.kind,
            "parameters": list(calibration.curve.parameters),
            "black_dn": calibration.black_dn,
            "max_dn": calibration.max_dn,
            "u_light_relative": calibration.u_light_relative,
        },
        "notes": list(calibration.notes),
    }


def _row(quantity: Quantity, stated: float | None) -> tuple[str, ...]:
    told = "" if stated is None else f"{stated:.5g}"
    text = f"{_number(quantity)} {quantity.unit}".strip()
    return quantity.name, quantity.symbol, text if quantity.value is not None else "unknown", told


def _number(quantity: Quantity) -> str:
    """Return value ± u with two digits of u; without a u, three digits of the value."""
    value, u = quantity.value, quantity.u
    if value is None:
        return ""
    if not u:
        return f"{value:.3g}"
    digits = 1 - math.floor(math.log10(u))
    value, u, shown = round(value, digits), round(u, digits), max(digits, 0)
    return f"{value:.{shown}f} ± {u:.{shown}f}"
