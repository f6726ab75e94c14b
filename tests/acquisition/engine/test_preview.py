"""Preview: the outline encloses the window's pixels in the small picture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from acquisition.engine.exposure.exposer import Exposed
from acquisition.engine.preview import make_preview
from acquisition.measure.radiometry import Dark
from acquisition.measure.window import window_at
from acquisition.plan.plan import make_plan
from instrument.config.load import Loaded
from instrument.devices import Frame
from instrument.pinhole import Pinhole


def test_the_outline_encloses_the_bright_pixels_of_the_small_picture(small: Loaded) -> None:
    step, camera = make_plan(small).points[2], small.rig.camera
    window = window_at(step.pose.theta_r, Pinhole.of(small.rig), 20.0, 20.0)
    image = np.zeros((camera.height_px, camera.width_px), np.uint16)
    image[window.crop][window.counted] = camera.max_dn
    dark = Dark(0.01, np.zeros(image.shape), np.zeros(image.shape), 1)
    exposed = Exposed(
        step=step, frames=[Frame(image, 0.01, 0.0)], dark=dark, time_s=0.0, free_s=0.0, time_utc=""
    )
    preview = make_preview(exposed, window, camera.max_dn)
    picture = cv2.imdecode(np.frombuffer(preview.png, np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (camera.height_px // 2, camera.width_px // 2)
    assert picture.dtype == np.uint8
    rows, columns = np.nonzero(picture > 127)
    outline = np.array(preview.polygon)  # (column, row)
    for pixels, corners in ((columns, outline[:, 0]), (rows, outline[:, 1])):
        assert pixels.min() == pytest.approx(corners.min(), abs=1.0)
        assert pixels.max() == pytest.approx(corners.max(), abs=1.0)
