"""Readings and a small record made by hand, without a scan."""

from __future__ import annotations

from pathlib import Path

from instrument.devices import Frame
from instrument.record.reading import Check, Preview, Reading
from instrument.record.record import Record


def reading(step: int = 0, **changes: object) -> Reading:
    """Return a plausible reading; `changes` replace its values by name."""
    values: dict[str, object] = {
        "step": step, "kind": "point", "surface": "sample", "theta_i_deg": 30.0, "dphi_deg": 0.0,
        "theta_r_deg": -20.0, "lamp_setting": 0, "block": 0, "signal_dn": 2000.5,
        "u_noise_dn": 0.1, "u_quantisation_dn": 0.01, "u_dark_dn": 0.02, "u_placement_dn": -0.4,
        "u_texture_dn": 0.1,
        "exposure_s": 0.032, "frames": 4, "window_pixels": 31000.25, "saturated_pixels": 0,
        "peak_dn": 2500.0, "time_s": 12.5, "free_s": 12.5, "flags": "",
        "time_utc": "2026-01-01T00:00:00+00:00",
    }  # fmt: skip
    return Reading(**{**values, **changes})  # type: ignore[arg-type]  # a test's shorthand


def small_record(folder: Path) -> Record:
    """Create a record with at least one row in each table, and leave it open."""
    record = Record.create(folder, {"steps": "5", "hidden": "0", "protocol": "name: größer"})
    record.add_device("camera", "maker, model, serial number")
    record.add_settings("2026", "camera", {"gain": "1"})
    record.add_event("2026", "operator", "done")
    record.add_dark("2026", 0.032, 8, 64.0, 1.1)
    for step, kind in enumerate(("drift", "tile", "point", "point", "drift")):
        row = reading(step, kind=kind, time_s=10.0 * step)
        frame = Frame(None, 0.032, 10.0 * step)  # type: ignore[arg-type]  # the image is not kept
        picture = Preview(step, "a view", b"\x89PNG", [[0.0, 1.5], [2.0, 3.0]])
        record.add_reading(row, picture, [frame], [f"frames/{step}.tiff"])
    again = reading(0, kind="drift", time_s=25.0)
    record.add_check(
        Check(before_step=3, expected=62500.0, u_expected=10.0, jumped=False, reading=again)
    )
    return record
