"""Optimal plan: within what the protocol allows, whatever the zones; and its figures."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import Phase, given, reject, settings

from acquisition.design.assumed_sample import assumed_sample
from acquisition.design.geometries import settings_of
from acquisition.design.optimal_plan import OptimalPlan, Planner
from acquisition.plan.keep_out import enters_zone
from acquisition.plan.plan import make_plan, min_separation_deg
from analysis.design.optimal import LACK_OF_FIT
from instrument.config.axes import AXES
from instrument.config.load import Loaded
from instrument.config.protocol import FitConfig
from instrument.errors import InputError
from tests.support.random_plans import scans
from tests.support.scans import changed

MATT = FitConfig(models=["lambert", "minnaert"])


@given(loaded=scans())
@settings(max_examples=6, deadline=None, phases=[Phase.explicit, Phase.generate])
def test_a_chosen_plan_stays_within_the_sweeps_and_out_of_the_zones(loaded: Loaded) -> None:
    own = None
    with suppress(InputError):
        own = make_plan(loaded)
    if own is None or len(own.points) < 5:
        reject()
    loaded = changed(loaded, fit=MATT)
    count = 5
    found = _optimal(loaded, count)
    if found is None:
        reject()
    views = settings_of(own)
    poses = [step.pose for step in found.chosen.plan.points]
    assert len(set(poses)) == len(found.reasons) == count
    for pose in poses:
        within = views[pose.theta_i, pose.dphi]
        assert within[0] <= pose.theta_r <= within[-1]
        assert pose.separation_deg >= min_separation_deg(loaded.rig)
        zones = loaded.rig.keep_out
        assert not any(enters_zone(zone, pose, pose, axis) for zone in zones for axis in AXES)


def _optimal(loaded: Loaded, count: int) -> OptimalPlan | None:
    """Plan for a matt sample, or None where a zone bars the way, as the error then says."""
    sample = assumed_sample("minnaert:albedo=0.5,k=0.8", loaded)
    try:
        return Planner.of(loaded, sample, ["k"], count).optimal(count)
    except InputError as error:
        if "keep-out zone" not in str(error):
            raise
        return None


def test_the_plan_has_its_figures_beside_the_sweeps(small: Loaded) -> None:
    loaded = changed(small, fit=FitConfig(models=["lambert+torrance_sparrow", "lambert"]))
    sample = assumed_sample(None, loaded)
    planner = Planner.of(loaded, sample, ["sigma_deg"], 6)
    found = planner.optimal(6)
    assert len(found.chosen.plan.points) == 6
    assert found.reasons.count(LACK_OF_FIT) == 2
    assert found.chosen.u == pytest.approx(planner.chosen(6)[1].u)
    assert found.between > 0
    assert set(found.rivals) == {"lambert+torrance_sparrow", "lambert"}
    assert found.sweeps.u["sigma_deg"] > 0
    assert 0.3 < found.efficiency <= 1
    minutes = [planner.uniform(views).minutes for views in (2, 3, 5)]
    assert np.all(np.diff(minutes) > 0)


@pytest.mark.parametrize("count", [2, 1000])
def test_a_count_beyond_the_candidates_is_refused(small: Loaded, count: int) -> None:
    with pytest.raises(InputError, match=f"--optimal {count}; allowed: 3"):
        Planner.of(small, assumed_sample(None, small), ["sigma_deg"], count)


def test_a_protocol_with_fewer_geometries_than_parameters_is_refused(small: Loaded) -> None:
    few = changed(small, sweeps=[{"theta_i_deg": [30.0], "dphi_deg": [0.0], "theta_r_deg": [0.0]}])
    with pytest.raises(InputError, match="have 1 geometries that can be used, and 3 parameters"):
        Planner.of(few, assumed_sample(None, few), ["sigma_deg"], 3)
