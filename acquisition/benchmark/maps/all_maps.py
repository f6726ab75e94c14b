"""All maps of where methods fail, in the order of the page."""

from __future__ import annotations

from collections.abc import Iterator

from acquisition.benchmark.maps.condition_map import SAMPLES, condition_picture
from acquisition.benchmark.maps.model_maps import FORMS, lobe_picture, rough_picture, smooth_picture
from acquisition.benchmark.maps.sample_map_cost import sample_map_picture
from acquisition.benchmark.maps.window_map import window_picture
from acquisition.benchmark.result import MapPicture


def draw_maps() -> Iterator[MapPicture]:
    """Draw the maps of the rough surface, the dielectric, the lobe, the fit and the window.

    The cost of a map of the sample comes last.
    """
    yield from map(rough_picture, FORMS)
    yield smooth_picture()
    yield lobe_picture()
    yield from map(condition_picture, SAMPLES)
    yield window_picture()
    yield sample_map_picture()
