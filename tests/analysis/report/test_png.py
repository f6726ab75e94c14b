"""Small PNG files: read back by another program's library as they were written."""

import cv2
import numpy as np
import pytest

from analysis.report.png import difference_pixels, grey_pixels, image_html, png_of

RNG = np.random.default_rng(4)


def test_a_picture_is_read_back_as_it_was() -> None:
    pixels = RNG.integers(0, 256, (int(RNG.integers(1, 40)), 17, 3), dtype=np.uint8)
    read = cv2.imdecode(np.frombuffer(png_of(pixels), np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(read[..., ::-1], pixels)


def test_a_screen_shines_in_proportion_to_the_value() -> None:
    """Decoded by the formula of IEC 61966-2-1, of which the middle grey 188 is half of white."""
    values = RNG.uniform(0, 2, (1, 50))
    encoded = grey_pixels(values, 2.0)[0, :, 0] / 255
    decoded = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    assert 2 * decoded == pytest.approx(values[0], abs=0.01)
    assert grey_pixels(np.array([[1.0, 2.0, 0.0, np.nan]]), 2.0)[0, :, 1].tolist() == [
        188, 255, 0, 0
    ]  # fmt: skip


def test_differences_have_a_colour_for_each_sign() -> None:
    rise, zero, fall, outside = difference_pixels(np.array([[1.0, 0.0, -1.0, np.nan]]), 1.0)[0]
    assert rise[0] > rise[2]
    assert fall[2] > fall[0]
    assert len(set(zero)) == 1
    assert not outside.any()


def test_a_picture_in_a_page_has_its_size_and_its_label() -> None:
    html = image_html(np.zeros((2, 3, 3), dtype=np.uint8), "a sphere")
    assert 'viewBox="0 0 3 2"' in html
    assert 'aria-label="a sphere"' in html
