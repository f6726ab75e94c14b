"""Small 8-bit pictures of selected frames, for the report."""

from __future__ import annotations

import cv2
import numpy as np

from acquisition.engine.exposure.exposer import Exposed
from acquisition.measure.window import Window
from instrument.record.reading import Preview


def make_preview(exposed: Exposed, window: Window, max_dn: int) -> Preview:
    """Return the first frame at half size in 8 bit, with the window's outline in its pixels."""
    image = exposed.frames[0].image.astype(np.float32) * np.float32(255.0 / max_dn)
    small = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    png = cv2.imencode(".png", np.clip(small, 0, 255).astype(np.uint8))[1].tobytes()
    outline = (window.outline_px + 0.5) / 2 - 0.5
    pose = exposed.step.pose
    caption = f"θᵢ {pose.theta_i:g}°, Δφ {pose.dphi:g}°, view angle θᵣ {pose.theta_r:g}°"
    return Preview(step=exposed.step.index, caption=caption, png=png, polygon=outline.tolist())
