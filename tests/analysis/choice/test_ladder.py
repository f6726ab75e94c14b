"""Ladder of candidates: names, order and methods for the rough surface."""

from __future__ import annotations

import pytest

from analysis.choice.ladder import LADDER, METHODS, RICH, functional_form, physics, with_method
from analysis.models import MODELS


def test_candidates_are_known_models_of_few_parameters_in_rising_order() -> None:
    for names, most in ((LADDER, 3), (RICH, 5)):
        assert max(len(MODELS[name].parameters) for name in names) == most
    first = [next(n for n, name in enumerate(LADDER) if physics(name) == p) for p in
             dict.fromkeys(map(physics, LADDER))]  # fmt: skip
    sizes = [len(MODELS[LADDER[n]].parameters) for n in first]
    assert sizes[0] == 1
    assert sizes == sorted(sizes)


@pytest.mark.parametrize("method", METHODS)
def test_one_method_for_the_rough_surface_leaves_each_physics_once(method: str) -> None:
    names = with_method(LADDER, method)
    assert set(map(physics, names)) == set(map(physics, LADDER))
    assert (len(names) == len(set(map(physics, names)))) == (method != "auto")


def test_the_functional_form_replaces_the_integral() -> None:
    assert functional_form("oren_nayar_exact+torrance_sparrow") == "oren_nayar+torrance_sparrow"
    assert functional_form("oren_nayar+torrance_sparrow") is None
