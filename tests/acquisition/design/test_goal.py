"""Goal of a scan: which texts are one, and which are refused."""

from __future__ import annotations

import pytest

from acquisition.design.assumed_sample import assumed_sample
from acquisition.design.goal import Goal, goal_of
from instrument.config.load import Loaded
from instrument.config.protocol import References
from instrument.errors import InputError
from tests.support.scans import changed


def test_a_goal_names_parameters_with_their_u(small: Loaded) -> None:
    goal = goal_of("sigma_deg=0.2, albedo = 0.005", assumed_sample(None, small), small)
    assert goal == Goal({"sigma_deg": 0.2, "albedo": 0.005})
    assert goal_of(goal.text, assumed_sample(None, small), small) == goal


def test_it_is_reached_only_with_every_u_of_it() -> None:
    goal = Goal({"sigma_deg": 0.2, "albedo": 0.005})
    assert goal.missed({"sigma_deg": 0.2, "albedo": 0.005, "ks": 9.0}) == []
    assert goal.missed({"sigma_deg": 0.21, "albedo": 0.004}) == ["sigma_deg"]
    assert goal.missed({"sigma_deg": float("nan"), "albedo": 1.0}) == ["sigma_deg", "albedo"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sigma_deg", "--until: sigma_deg; allowed: NAME=U"),
        ("", "--until: nothing; allowed: NAME=U"),
        ("sigma_deg=0.2,", "--until: nothing; allowed"),
        ("=0.2", "--until: =0.2; allowed: NAME=U"),
        ("sigma_deg=small", "--until: sigma_deg=small; allowed: NAME=U"),
        ("sigma_deg=0.2,sigma_deg=0.3", "sigma_deg is named twice"),
        ("sigma_deg=0", "--until sigma_deg=0; allowed: a standard uncertainty of more than 0"),
        ("sigma_deg=-1", "--until sigma_deg=-1; allowed"),
        ("sigma_deg=nan", "--until sigma_deg=nan; allowed"),
        ("albedo=0.3", "--until albedo=0.3; allowed: .* up to 0.25"),
        ("n=0.1", "--until: .* has no parameter n; allowed: albedo, sigma_deg, ks"),
    ],
)
def test_what_is_no_goal_is_refused(small: Loaded, text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        goal_of(text, assumed_sample(None, small), small)


def test_a_scan_without_a_white_tile_has_no_goal_for_the_albedo(small: Loaded) -> None:
    relative = changed(small, references=References())
    with pytest.raises(InputError, match="--until albedo: not determined without a white tile"):
        goal_of("albedo=0.01", assumed_sample(None, small), relative)
