"""`gonio models`: names and parameters as in Python, and what completes in the shell."""

from __future__ import annotations

import json

from acquisition.commands.models import completed_names
from analysis.choice.ladder import CANDIDATES
from analysis.models import MODELS
from tests.support.command import gonio_here as gonio


def test_every_model_is_listed_with_its_parameters() -> None:
    text = gonio("models").stdout
    listed = json.loads(gonio("models", "--json").stdout)
    assert list(listed["models"]) == list(MODELS)
    assert listed["candidates"] == list(CANDIDATES)
    for name, model in MODELS.items():
        assert f"\n{name} " in f"\n{text}"
        given = listed["models"][name]
        assert [(n, p["low"], p["high"]) for n, p in given.items()] == [
            (p.name, p.low, p.high) for p in model.parameters
        ]
        assert all(p.name in text for p in model.parameters)


def test_a_sum_can_be_asked_for_and_a_wrong_name_is_answered() -> None:
    assert "alpha" in gonio("models", "lambert+ggx").stdout
    wrong = gonio("models", "lamber")
    assert wrong.returncode == 2
    assert "did you mean lambert?" in wrong.stderr


def test_the_last_of_several_names_is_completed() -> None:
    assert completed_names("oren_nayar_e") == [
        "oren_nayar_exact",
        "oren_nayar_exact+torrance_sparrow",
        "oren_nayar_exact+torrance_sparrow+single_scattering",
    ]
    assert completed_names("lambert,wolff_") == ["lambert,wolff_oren_nayar"]
    assert completed_names("lambert,no") == []
