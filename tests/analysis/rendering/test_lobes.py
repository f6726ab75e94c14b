"""Polar lobes of a model add up to it."""

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.rendering.lobes import lobes
from instrument.geometry import Geometry


def test_lobes_of_a_model_add_up_to_it() -> None:
    views = np.linspace(-85, 85, 35)
    for name in ("unified", "oren_nayar+torrance_sparrow", "lambert"):
        model = MODELS[name]
        values = {p.name: p.default for p in model.parameters}
        parts = lobes(model, values, 40.0, views)
        whole = model.brdf(Geometry.from_degrees(theta_i=40.0, theta_r=views), **values)
        assert sum(parts.values()) == pytest.approx(whole)
        assert len(parts) == {"unified": 3, "lambert": 1}.get(name, 2)
