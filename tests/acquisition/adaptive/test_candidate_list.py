"""List of candidates: its text gives the same list again; wrong goals are named by place."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.adaptive.aims import Aims
from acquisition.adaptive.candidate_list import candidate_list, goal_of_protocol, with_goal
from acquisition.plan.plan import make_plan
from acquisition.results.model_check import check_model
from instrument.config.load import Loaded, load_protocol
from instrument.errors import InputError
from tests.support.scans import changed, small_demo


@pytest.fixture
def demo(tmp_path: Path) -> Loaded:
    return load_protocol(small_demo(tmp_path), None, check_model=check_model)


def test_the_text_of_the_list_gives_the_same_list_again(demo: Loaded) -> None:
    listed = candidate_list(with_goal(demo, "sigma_deg=0.2,albedo=0.005", 30))
    again = demo.protocol_path.with_name("again.yaml")
    again.write_text(listed.protocol_text)
    loaded = load_protocol(again, None, check_model=check_model)
    assert loaded.protocol.model_copy(update={"rig": listed.protocol.rig}) == listed.protocol
    assert make_plan(loaded).steps == make_plan(listed).steps
    assert goal_of_protocol(loaded) == {"sigma_deg": 0.2, "albedo": 0.005}
    assert loaded.protocol.budget_min == 30
    assert len(make_plan(loaded).points) > 1.7 * len(make_plan(demo).points)


def test_options_stand_in_place_of_the_goal_of_the_protocol(demo: Loaded) -> None:
    path = demo.protocol_path.with_name("goal.yaml")
    path.write_text(f"{demo.protocol_text}goal: {{ks: {{u: 0.01}}}}\nbudget_min: 20\n")
    loaded = load_protocol(path, None, check_model=check_model)
    assert goal_of_protocol(with_goal(loaded, None, None)) == {"ks": 0.01}
    other = with_goal(loaded, "sigma_deg=0.5", 10)
    assert goal_of_protocol(other) == {"sigma_deg": 0.5}
    assert other.protocol.budget_min == 10
    assert with_goal(loaded, "sigma_deg=0.5", None).protocol.budget_min == 20


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("goal: {sigma: {u: 0.2}}", r"goal.yaml:\d+:\d+: goal.sigma: no parameter .* sigma_deg"),
        ("goal: {sigma_deg: {u: 80.0}}", r"goal.sigma_deg: u 80; allowed: more than 0, up to"),
        ("goal: {sigma_deg: {u: -0.2}}", r"goal.sigma_deg.u: -0.2 is too small; allowed: a number"),
        ("goal: {sigma_deg: 0.2}", r"goal.sigma_deg: 0.2 is a number; allowed: a block with u"),
        ("goal: {ks: {u: 0.1}}\nmotion: fly", r"motion: fly beside a goal; allowed: stepped"),
        ("budget_min: 30.0", r"budget_min: 30 without a goal; allowed: beside goal"),
    ],
)
def test_a_wrong_goal_in_a_protocol_is_named_with_its_place(
    demo: Loaded, entry: str, words: str
) -> None:
    path = demo.protocol_path.with_name("goal.yaml")
    path.write_text(f"{demo.protocol_text}{entry}\n")
    with pytest.raises(InputError, match=words):
        Aims.of(load_protocol(path, None, check_model=check_model))


@pytest.mark.parametrize(
    ("until", "budget_min", "words"),
    [
        ("sigma=0.2", None, r"--until sigma: no parameter .* allowed: .*sigma_deg"),
        ("sigma_deg=0", None, r"--until sigma_deg: u 0; allowed: more than 0"),
        ("sigma_deg=nan", None, r"--until sigma_deg: u nan; allowed: more than 0"),
        ("sigma_deg", None, r"--until: sigma_deg; allowed: NAME=U"),
        ("sigma_deg=0.2", -1.0, r"--budget-min -1; allowed: minutes, more than 0"),
        (None, 5.0, r"--budget-min: allowed with --until"),
    ],
)
def test_a_wrong_goal_in_an_option_is_named(
    demo: Loaded, until: str | None, budget_min: float | None, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        Aims.of(with_goal(demo, until, budget_min))


def test_a_scan_that_does_not_stop_cannot_choose_its_points(demo: Loaded) -> None:
    flying = changed(demo, motion="fly")
    with pytest.raises(InputError, match=r"--until: not for motion: fly in .*; allowed: stepped"):
        with_goal(flying, "ks=0.1", None)


def test_without_a_white_tile_no_scale_can_be_asked_for(demo: Loaded) -> None:
    path = demo.protocol_path.with_name("relative.yaml")
    kept = [line for line in demo.protocol_text.splitlines() if not line.startswith("  white_tile")]
    path.write_text("\n".join(kept) + "\n")
    loaded = load_protocol(path, None, check_model=check_model)
    with pytest.raises(InputError, match=r"--until albedo: no parameter .* sigma_deg"):
        Aims.of(with_goal(loaded, "albedo=0.01", None))
