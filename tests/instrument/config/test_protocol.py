"""Protocol models: their own rules hold for Python callers, too."""

import pytest
import yaml
from pydantic import ValidationError

from instrument.config.protocol import (
    FitConfig,
    Protocol,
    SimulatedSample,
    Steps,
    WhiteTile,
    angles_deg,
)
from tests.support.config.texts import PROTOCOL


def test_angles_are_laid_out_in_the_order_of_the_file() -> None:
    assert angles_deg([30.0, 10.0]).tolist() == [30.0, 10.0]
    assert angles_deg(Steps(start=5.0, stop=-5.0, num=3)).tolist() == [5.0, 0.0, -5.0]
    assert angles_deg(Steps(start=5.0, stop=5.0, num=1)).tolist() == [5.0]


def test_one_angle_needs_equal_ends_and_more_need_different_ones() -> None:
    with pytest.raises(ValidationError, match="num: 1; allowed: 2 or more from 0 to 5"):
        Steps(start=0.0, stop=5.0, num=1)
    with pytest.raises(ValidationError, match="num: 3; allowed: 1, as start = stop = 5"):
        Steps(start=5.0, stop=5.0, num=3)


def test_an_uncertainty_of_half_the_reflectance_is_refused() -> None:
    """It was probably given in %."""
    with pytest.raises(ValidationError, match=r"u_reflectance: 0\.5; allowed: less than half"):
        WhiteTile(reflectance=0.99, u_reflectance=0.5)


def test_a_method_beside_named_models_is_refused() -> None:
    with pytest.raises(ValidationError, match="method: exact; allowed: auto, as `models` names"):
        FitConfig(models=["oren_nayar"], method="exact")


def test_the_same_schema_guards_python_callers() -> None:
    with pytest.raises(ValueError, match="at least 3 items"):
        Protocol.model_validate({**yaml.safe_load(PROTOCOL), "sweeps": [{"dphi_deg": [0.0]}]})


def test_the_default_method_is_auto() -> None:
    assert FitConfig().method == SimulatedSample(model="lambert", parameters={}).method == "auto"
    assert FitConfig(method="exact").models is None
