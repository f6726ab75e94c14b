"""The simulated operator."""

from __future__ import annotations

import pytest

from instrument.config.load import load_protocol
from instrument.devices import Request
from sim.clock import SimulatedClock
from sim.scene.operator import SimulatedOperator
from tests.support.paths import CONFIGS
from tests.support.scans import simulated_scene


def test_the_operator_carries_out_every_request_in_simulated_time() -> None:
    hand_set = load_protocol(
        CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / "paper_1995.yaml"
    )
    scene, clock = simulated_scene(hand_set), SimulatedClock()
    operator = SimulatedOperator(scene, clock)
    answer = operator.ask(Request("set axis", "", axis="theta_i", angle_deg=60.0))
    assert answer == "60"
    assert scene.true_deg["theta_i"] == pytest.approx(60.0, abs=2.0)
    operator.ask(Request("place", "", surface="white tile"))
    operator.ask(Request("cover lamp", ""))
    assert (scene.surface, scene.lit) == ("white tile", False)
    operator.ask(Request("uncover lamp", ""))
    assert scene.lit
    assert clock.now_s() == pytest.approx(60 + 60 + 15 + 15)
