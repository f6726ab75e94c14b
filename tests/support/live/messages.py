"""Messages of a scan that never was, as the live page gets them."""

from __future__ import annotations

from typing import Any

Content = dict[str, Any]
POINTS = 24
RUN: Content = {
    "title": "demo", "sample": "foam", "folder": "runs/demo", "rig": "bench", "quantity": "BRDF",
    "unit": "1/sr", "steps": POINTS, "points": POINTS, "started_utc": "2026-11-28T04:00:00Z",
    "sweep": "theta_r", "range_deg": [-60, 50], "aiming": False,
}  # fmt: skip
AIMING: Content = RUN | {"title": "Aiming", "steps": 0, "points": 0, "aiming": True}
SATURATED = 14
"""Step of the point with saturated pixels: θᵢ 60°, θᵣ −40°."""


def point(step: int) -> Content:
    """Message of a point: 12 view angles at each of two incidences."""
    incidence, view = (30.0, 60.0)[step // 12], -60.0 + 10.0 * (step % 12)
    saturated = step == SATURATED
    return {
        "step": step, "kind": "point", "theta_i_deg": incidence, "theta_r_deg": view,
        "dphi_deg": 0.0, "curve": f"θᵢ {incidence:g}°", "x_deg": view, "value": 0.3 + step / 1000,
        "u": 0.004, "flags": ["saturated"] if saturated else [], "signal_dn": 2000.0 + step,
        "peak_dn": 4095 if saturated else 3000, "full_scale_dn": 4095,
        "saturated_pixels": 143 if saturated else 0, "exposure_s": 0.0123, "frames": 4,
        "window_pixels": 1531.0, "time_utc": "2026-11-28T04:01:00Z", "has_frame": False,
    }  # fmt: skip


def progress(done: int, state: str = "measuring", *actions: str) -> Content:
    """Message of the progress of the scan, in a state with what may be asked for in it."""
    return {
        "done": done, "total": POINTS, "elapsed_s": 7.0 * done, "left_s": 7.0 * (POINTS - done),
        "state": state, "text": f"said by the scan: {state}", "actions": list(actions),
    }  # fmt: skip


def model(points: int) -> Content:
    """Message of the best model, with a line for the first curve."""
    line = {"curve": "θᵢ 30°", "x_deg": [-60.0, 0.0, 50.0], "value": [0.3, 0.306, 0.311]}
    return {
        "name": "oren_nayar", "text": "oren_nayar, adequate: σ 20.1° ± 0.4°",
        "verdict": "adequate", "points": points, "lines": [line],
    }  # fmt: skip


def aim(sharpness: float, best: float, saturated: int = 0) -> Content:
    """Message of the camera that is being aimed."""
    return {
        "sharpness": sharpness, "best_sharpness": best, "saturated_pixels": saturated,
        "window_saturated_pixels": saturated // 2, "window_mean_dn": 2800.0,
        "peak_dn": 4095 if saturated else 3500, "full_scale_dn": 4095, "exposure_s": 0.0123,
    }  # fmt: skip
