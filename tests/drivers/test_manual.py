"""Devices served by hand: the operator's answers, and prompts until they are within tolerance."""

from __future__ import annotations

import pytest

from drivers.manual import HandCoveredLamp, HandSetAxis
from instrument.devices import Request
from instrument.errors import DeviceError


class Answers:
    """Operator with prepared answers; `asked` holds the prompts."""

    def __init__(self, *answers: str) -> None:
        self.answers, self.asked = list(answers), []

    def ask(self, request: Request) -> str:
        self.asked.append(request.text)
        return self.answers.pop(0)


@pytest.mark.parametrize(("answer", "angle_deg"), [("", 30.0), ("done", 30.0), ("30.2", 30.2),
                                                   ("29,9", 29.9), ("30.1°", 30.1)])  # fmt: skip
def test_the_angle_reported_by_the_operator_counts(answer: str, angle_deg: float) -> None:
    axis = HandSetAxis("theta_i", "the lamp's angle", Answers(answer), tolerance_deg=0.75)
    axis.start_move(30.0)
    assert axis.wait() == axis.position_deg() == angle_deg


def test_an_angle_out_of_tolerance_is_asked_for_again() -> None:
    operator = Answers("35", "thirty", "30.5")
    axis = HandSetAxis("theta_i", "the lamp's angle", operator, tolerance_deg=0.75)
    axis.start_move(30.0)
    assert axis.wait() == 30.5
    assert "'35' is not within 0.75 degrees of 30" in operator.asked[1]
    assert "'thirty' is not within 0.75 degrees of 30" in operator.asked[2]


def test_an_axis_that_was_never_set_has_no_position() -> None:
    axis = HandSetAxis("theta_i", "the lamp's angle", Answers(), tolerance_deg=0.75)
    with pytest.raises(DeviceError, match="theta_i is set by hand and has not been set yet"):
        axis.position_deg()


def test_the_operator_covers_and_uncovers_the_lamp() -> None:
    operator = Answers("", "")
    lamp = HandCoveredLamp(operator)
    lamp.darken()
    lamp.light()
    assert operator.asked == ["Cover the lamp: dark frames are next", "Uncover the lamp"]
