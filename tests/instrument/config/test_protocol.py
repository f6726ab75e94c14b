"""Protocol models: their own rules hold for Python callers, too."""

import re

import pytest
import yaml
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ValidationError

from instrument.config.protocol import (
    FitConfig,
    Metadata,
    Protocol,
    Steps,
    WhiteTile,
    angles_deg,
)
from instrument.config.simulated.sample import SimulatedSample
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


ends = st.integers(-360_000, 360_000).map(lambda thousandths: thousandths / 1000)


@given(ends, ends, st.integers(2, 2000))
def test_a_step_and_a_number_are_two_ways_to_say_the_same(
    start: float, stop: float, num: int
) -> None:
    assume(abs(stop - start) > 0.01)
    by_num = Steps(start=start, stop=stop, num=num)
    by_step = Steps(start=start, stop=stop, step=abs(stop - start) / (num - 1))
    assert by_step.count == num
    assert angles_deg(by_step).tolist() == angles_deg(by_num).tolist()


@given(ends, ends, st.floats(0.01, 720))
def test_a_step_that_misses_the_end_is_answered_with_one_that_does_not(
    start: float, stop: float, step: float
) -> None:
    try:
        angles = angles_deg(Steps(start=start, stop=stop, step=step))
    except ValidationError as error:
        found = re.search(r"or num: ([0-9]+)", str(error))
        assert (found is None) == (start == stop)
        if found is not None:
            assert Steps(start=start, stop=stop, num=int(found[1])).count == int(found[1])
    else:
        assert abs(angles[1] - angles[0]) == pytest.approx(step, rel=1e-5)
        assert (angles[0], angles[-1]) == (start, stop)


def test_too_many_steps_are_refused() -> None:
    with pytest.raises(ValidationError, match=r"step: 0\.0001 gives 1000001 angles; allowed: at"):
        Steps(start=0.0, stop=100.0, step=1e-4)


def test_metadata_are_given_as_text_in_one_line() -> None:
    found = Metadata(
        wavelength_nm=632.8, notes="first of three\n", operator="Jürgen", filter="OD 2"
    )
    assert found.given() == {
        "operator": "Jürgen", "wavelength_nm": "632.8", "filter": "OD 2", "notes": "first of three",
    }  # fmt: skip
    assert Metadata().given() == {}


@pytest.mark.parametrize(
    "note", ["=1+1", "+x", "-x", "@x", "a\nb", "a\tb", "a\rb", "\x1b[2J", "", " x"]
)
def test_metadata_that_a_table_cannot_hold_are_refused(note: str) -> None:
    """A spreadsheet would compute a cell that begins like a formula."""
    with pytest.raises(ValidationError):
        Metadata(notes=note)


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
