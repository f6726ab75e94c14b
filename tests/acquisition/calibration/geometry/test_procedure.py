"""Calibration of drawn simulated benches: values within u, and what stops it."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from acquisition.calibration.geometry.plan import GeometryPlan
from acquisition.calibration.geometry.result import geometry_of
from instrument.board import Board
from instrument.calibration.geometry_file import GeometryCalibration
from instrument.config.load import load_rig
from instrument.config.rig import Rig
from instrument.devices import Request
from instrument.errors import NotDetermined
from sim.scene.operator import SimulatedOperator
from tests.support.calibration.board_pictures import drawn
from tests.support.calibration.drawn_benches import REAL, calibrated, drawn_rig, true_values

STATED = load_rig(REAL)
QUICK: dict[str, Any] = {"poses": 9, "frames": 1, "theta_i_deg": 22.0, "u_square_mm": 0.0}
POSES = np.array([p.theta_r for p in GeometryPlan(rig=STATED, **QUICK).usable()])


def pulls(truth: Rig, found: GeometryCalibration) -> dict[str, float]:
    """(value - truth) / u of each quantity, with the u that its own fit states."""
    values = {}
    for key, true in true_values(truth, POSES).items():
        quantity = found.quantities[key]
        assert quantity.value is not None
        assert quantity.u
        values[key] = (quantity.value - true) / quantity.u
    return values


def test_drawn_benches_are_found_within_their_u(slow: bool) -> None:
    """All defects of bench_real drawn anew, and the camera's geometry, which no file states."""
    rows = []
    for seed in range(40 if slow else 1):
        truth = drawn_rig(seed)
        calibration = calibrated(truth, STATED, **QUICK)
        assert not any("squares are" in note for note in calibration.notes)
        rows.append(pulls(truth, calibration))
    found = {key: np.array([row[key] for row in rows]) for key in rows[0]}
    everything = np.concatenate(list(found.values()))
    assert np.mean(np.abs(everything) < 3) > (0.97 if slow else 0.85), found
    assert np.abs(everything).max() < 5, found
    if slow:
        spread = {key: float(np.sqrt(np.mean(own**2))) for key, own in found.items()}
        assert 0.7 < np.sqrt(np.mean(everything**2)) < 1.2, spread
        assert max(spread.values()) < 1.6, spread


def test_a_board_that_was_not_turned_is_noticed_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    ask = SimulatedOperator.ask

    def lazy(self: SimulatedOperator, request: Request) -> str:
        return "done" if request.surface == "turned board" else ask(self, request)

    monkeypatch.setattr(SimulatedOperator, "ask", lazy)
    with pytest.raises(NotDetermined, match="was turned by 0 deg; needed: 180, to 20"):
        calibrated(STATED, STATED, **(QUICK | {"poses": 5}))


@pytest.mark.parametrize(
    ("camera", "lamp", "words"),
    [
        ({"min_exposure_s": 0.2}, {}, "is saturated at the shortest exposure .*--theta-i-deg"),
        ({}, {"white_electrons_per_s": 5.0}, "no markers of DICT_4X4_50 found"),
    ],
    ids=["saturated", "dark"],
)
def test_a_picture_that_shows_nothing_ends_it(
    camera: dict[str, float], lamp: dict[str, float], words: str
) -> None:
    update = {
        "camera": STATED.camera.model_copy(update=camera),
        "lamp": STATED.lamp.model_copy(update=lamp),
    }
    rig = STATED.model_copy(update=update)
    with pytest.raises(NotDetermined, match=words):
        calibrated(rig, rig, **QUICK)


def test_a_board_with_other_columns_is_refused() -> None:
    other = Board(columns=7, rows=6, square_mm=7.0)
    with pytest.raises(NotDetermined, match="Compare --columns"):
        calibrated(STATED, STATED, other, **(QUICK | {"poses": 5}))


def test_squares_of_another_size_contradict_the_beam() -> None:
    """The corners are those of squares of 8 mm, 6 % larger than the beam lets expect."""
    own = drawn(1)
    beam_mm = 800.0 * (1 + own.truth["beam_percent"] / 100) / 1.06
    plan = GeometryPlan(rig=STATED.model_copy(update={"beam_length_mm": beam_mm}), **QUICK)
    words = "squares of 8 mm the camera would be .*; the rig file says .*--square-mm: 7[.]5"
    with pytest.raises(NotDetermined, match=words):
        geometry_of(
            own.corners, plan, camera="camera", stage="stage", skipped=[], now=datetime.now(UTC)
        )


def test_squares_of_few_pixels_are_named() -> None:
    own = drawn(1)
    beam_mm = 800.0 * (1 + own.truth["beam_percent"] / 100)
    rig = STATED.model_copy(update={"beam_length_mm": beam_mm})
    plan = GeometryPlan(rig=rig, **(QUICK | {"widest_deg": 75.0}))
    found = geometry_of(
        own.corners, plan, camera="camera", stage="stage", skipped=[], now=datetime.now(UTC)
    )
    assert any("squares are 18 px wide at 75 deg" in note for note in found.notes)
