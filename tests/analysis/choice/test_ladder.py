"""Ladder of candidates: names, order and methods for the rough surface."""

from __future__ import annotations

import pytest

from analysis.choice.ladder import CANDIDATES, METHODS, functional_form, physics, rungs, with_method
from analysis.models import MODELS


def test_rungs_have_one_number_of_parameters_and_rise() -> None:
    found = rungs(CANDIDATES)
    sizes = [{len(MODELS[name].parameters) for name in rung} for rung in found]
    assert sizes == [{1}, {2}, {3}, {4}, {5}]
    assert sorted(name for rung in found for name in rung) == sorted(CANDIDATES)
    assert rungs(["wolff", "lambert", "eon"]) == [("lambert",), ("wolff", "eon")]


@pytest.mark.parametrize("method", METHODS)
def test_one_method_for_the_rough_surface_leaves_each_physics_once(method: str) -> None:
    names = with_method(CANDIDATES, method)
    assert set(map(physics, names)) == set(map(physics, CANDIDATES))
    assert (len(names) == len(set(map(physics, names)))) == (method != "auto")


def test_the_functional_form_replaces_the_integral() -> None:
    assert functional_form("oren_nayar_exact+torrance_sparrow") == "oren_nayar+torrance_sparrow"
    assert functional_form("oren_nayar+torrance_sparrow") is None
