"""Time of a picture: a sphere of 512 x 512 pixels by a closed form takes at most 0.3 s."""

from functools import partial

import pytest

from analysis.models import MODELS
from analysis.rendering.light import light
from analysis.rendering.render import render
from analysis.rendering.shapes import sphere
from tests.support.timing.cpu_time import cpu_seconds

CLOSED_FORMS = ("lambert", "oren_nayar", "oren_nayar+torrance_sparrow")


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_a_large_sphere_is_drawn_at_once(name: str) -> None:
    model = MODELS[name]
    brdf = partial(model.brdf, **{p.name: p.default for p in model.parameters})
    assert cpu_seconds(lambda: render(sphere(512), brdf, [light(30, 40)]), repeats=2) < 0.3
