"""Checks as a choice of a model tells them: in its notes, and at little cost."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.choice import choice as choice_module
from analysis.choice.checks import all_checks
from analysis.choice.choice import Choice, choose
from analysis.choice.fit_json import to_json
from analysis.choice.notes import NoteCode
from analysis.data.measurements import Measurements
from tests.support.analysis.table_faults import (
    in_radians,
    lamp_swapped,
    matt_table,
    scaled,
    with_outliers,
)

CHECKS = {
    NoteCode.NOT_RECIPROCAL, NoteCode.REFLECTANCE_ABOVE_ONE, NoteCode.POSSIBLE_OUTLIERS,
    NoteCode.COSINE_FACTOR, NoteCode.ANGLE_UNIT, NoteCode.LAMP_SIDE,
}  # fmt: skip
FEW = ("lambert", "oren_nayar")


def told(found: Choice) -> list[NoteCode]:
    return [note.code for note in found.notes if note.code in CHECKS]


def table(stated: bool = True) -> Measurements:
    return matt_table(2, stated=stated).measurements


def test_sound_data_have_no_note_and_cost_no_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("outliers", "suspected_mistake", "reciprocity"):
        monkeypatch.delattr(all_checks, name)
    assert told(choose(table(), models=FEW)) == []


def test_sound_data_without_u_have_no_note() -> None:
    assert told(choose(table(stated=False), models=FEW)) == []


@pytest.mark.parametrize("stated", [True, False], ids=["u", "no u"])
def test_each_mistake_is_told_once(stated: bool) -> None:
    m = table(stated=stated)
    both = np.cos(m.geometry.theta_i) * np.cos(m.geometry.theta_r)
    spoilt = {
        NoteCode.LAMP_SIDE: lamp_swapped(m),
        NoteCode.COSINE_FACTOR: scaled(m, both),
        NoteCode.REFLECTANCE_ABOVE_ONE: scaled(m, 2 * np.pi),
        NoteCode.ANGLE_UNIT: in_radians(m),
        NoteCode.POSSIBLE_OUTLIERS: with_outliers(m, 0.05, 1)[0],
    }
    for code, wrong in spoilt.items():
        found = choose(wrong, models=FEW)
        assert told(found) == [code]
        assert str(code) in [note["code"] for note in to_json(found)["notes"]]


@pytest.mark.parametrize("incidences", [1, 2])
def test_a_lambertian_sample_times_cosines_is_not_taken_for_minnaerts(incidences: int) -> None:
    """Minnaert's law with k = 2 explains the values, so the misfit tells nothing."""
    m = matt_table(2, incidences=incidences).measurements
    noise = m.brdf / matt_table(2, incidences=incidences).brdf(m.geometry)
    cosines = np.cos(m.geometry.theta_i) * np.cos(m.geometry.theta_r)
    u = 0.003 * 0.2 * cosines
    wrong = replace(m, brdf=0.2 * noise * cosines, u_random=u)
    found = choose(wrong, models=["lambert", "minnaert"])
    assert (found.chosen, found.verdict) == ("minnaert", "adequate")
    (note,) = [note for note in found.notes if note.code in CHECKS]
    assert note.code is NoteCode.COSINE_FACTOR
    name = "cos(theta_r)" if incidences == 1 else "cos(theta_i) cos(theta_r)"
    assert f"Lambert's law times {name}:" in note.text


def test_a_robust_fit_suggests_no_robust_fit() -> None:
    m, _ = with_outliers(table(), 0.05, 1)
    assert NoteCode.POSSIBLE_OUTLIERS not in told(choose(m, models=FEW, robust=True))


def test_a_model_too_small_is_no_mistake_of_the_table() -> None:
    """Only Lambert's law is allowed: a rough sample is not explained, but the table is right."""
    found = choose(table(), models=["lambert"])
    assert found.verdict == "none adequate"
    assert told(found) == []


@pytest.mark.slow
def test_the_checks_cost_a_fifth_of_the_choice_at_most(
    monkeypatch: pytest.MonkeyPatch, slow: bool
) -> None:
    """In CPU time, over data that no model explains: 10 % to 15 %."""
    spent = 0.0
    notes = all_checks.check_notes

    def timed(*arguments: Any) -> Any:
        nonlocal spent
        before = time.process_time()
        found = notes(*arguments)
        spent += time.process_time() - before
        return found

    monkeypatch.setattr(choice_module, "check_notes", timed)
    started = time.process_time()
    for seed in range(6 if slow else 1):
        choose(lamp_swapped(matt_table(seed, stated=bool(seed % 2)).measurements))
    assert spent <= 0.2 * (time.process_time() - started)
