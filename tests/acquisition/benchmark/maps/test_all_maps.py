"""All maps: complete pictures with their numbers, readable in grey."""

from __future__ import annotations

import pytest

from acquisition.benchmark.maps.all_maps import draw_maps
from acquisition.benchmark.maps.model_maps import lobe_picture, smooth_picture
from tests.support.benchmark import check_complete


@pytest.mark.slow
def test_every_map_is_a_picture_with_its_numbers(slow: bool) -> None:
    """All with `pytest --slow`; else two: those of rough surface and window have own tests."""
    pictures = list(draw_maps()) if slow else [smooth_picture(), lobe_picture()]
    assert len({p.title for p in pictures}) == len(pictures)
    for picture in pictures:
        check_complete(picture)
