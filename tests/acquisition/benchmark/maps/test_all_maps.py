"""All maps: complete pictures with their numbers, readable in grey."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

from acquisition.benchmark.maps.all_maps import draw_maps
from acquisition.benchmark.maps.model_maps import lobe_picture, rough_picture, smooth_picture
from acquisition.benchmark.maps.window_map import window_picture
from acquisition.benchmark.result import MapPicture


def drawn(slow: bool) -> list[MapPicture]:
    if slow:
        return list(draw_maps())
    return [rough_picture("oren_nayar"), smooth_picture(), lobe_picture(), window_picture()]


@pytest.mark.slow
def test_every_map_is_a_picture_with_its_numbers(slow: bool) -> None:
    pictures = drawn(slow)
    assert len({p.title for p in pictures}) == len(pictures)
    for picture in pictures:
        page = ElementTree.fromstring(picture.svg)  # our own text, made above
        words = " ".join("".join(e.itertext()) for e in page.iter() if e.tag.endswith("text"))
        assert "°" in words or "g" in words
        assert "$" not in words  # no markup is left in a label
        assert picture.caption
        sizes = {len(values) for values in picture.columns.values()}
        assert len(sizes) == 1
        assert sizes.pop() > 100
        if "window" not in picture.title:  # its lines have markers and dashes of their own
            # Without colours: every fill and stroke is a grey.
            for colour in set(re.findall(r"#([0-9a-fA-F]{6})", picture.svg)):
                assert colour[:2].lower() == colour[2:4].lower() == colour[4:].lower()
