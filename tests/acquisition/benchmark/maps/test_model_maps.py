"""Maps of the models: they show their reasons, and their numbers are the errors."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.benchmark.maps.model_maps import rough_picture
from acquisition.benchmark.result import MapPicture
from analysis.models import MODELS
from instrument.geometry import Geometry
from tests.support.benchmark import check_complete

FORM = "oren_nayar_qualitative"


@pytest.fixture(scope="module")
def picture() -> MapPicture:
    return rough_picture(FORM)


def test_the_map_is_complete_and_its_reasons_are_in_the_picture(picture: MapPicture) -> None:
    check_complete(picture)
    assert "leaves" in picture.svg
    assert "interreflection" in picture.svg


def test_the_numbers_of_a_map_are_the_errors(picture: MapPicture) -> None:
    columns = picture.columns
    random = np.random.default_rng(1)
    for k in random.integers(0, len(columns["error_percent"]), 12):
        row = {name: float(values[k]) for name, values in columns.items()}
        there = Geometry.from_degrees(
            theta_i=row["theta_i_deg"], theta_r=row["theta_r_deg"], dphi=row["dphi_deg"]
        )
        off = []
        for albedo in (1e-9, 1.0):
            values = {"albedo": albedo, "sigma_deg": row["sigma_deg"]}
            exact = MODELS["oren_nayar_exact"].brdf(there, **values)
            off.append(abs(float(MODELS[FORM].brdf(there, **values) / exact - 1)))
        # The table in between is good to a percent of the value at the worst.
        assert row["error_percent"] == pytest.approx(100 * max(off), rel=0.02, abs=0.3)
