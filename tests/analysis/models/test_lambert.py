"""Lambert's law."""

from __future__ import annotations

import pytest

from tests.support.models.reflectance import hemispherical_reflectance


def test_the_albedo_is_reflected() -> None:
    found = hemispherical_reflectance("lambert", 0.0, albedo=0.7)
    assert found == pytest.approx(0.7, rel=1e-12)
