"""Lamps stand where their angles say, and never behind what is seen."""

import pytest

from analysis.rendering.light import light


def test_lamps_behind_the_surface_are_refused() -> None:
    assert light(90).direction[2] == 0
    with pytest.raises(ValueError, match=r"lamp at 100 degrees .* allowed: 0 to 90"):
        light(100)
    with pytest.raises(ValueError, match="irradiance = -1"):
        light(10, irradiance=-1)
