"""Random sequences of commands and mishaps: a stage never moves when or where it must not."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from instrument.config.axes import SimulatedAxis
from instrument.config.load import load_protocol
from instrument.devices import Stage
from instrument.errors import DeviceError
from sim.clock import SimulatedClock
from sim.emulated.motor import Motor
from sim.scene.scene import Scene
from sim.scene.stage import SimulatedStage
from tests.support.paths import CONFIGS
from tests.support.stages.emulated_stages import LIMITS, MECHANICS
from tests.support.stages.kinds import KINDS, SERIAL
from tests.support.stages.memory_stages import CountingClock, in_memory

STAGES = ("simulated", *SERIAL)
DEMO = load_protocol(CONFIGS / "protocols" / "demo.yaml")

HOME_DEG, TOLERANCE_DEG = 0.0, 0.011  # the bench's, and half a microstep
ANGLES_DEG = st.one_of(
    st.floats(-100.0, 100.0),
    st.sampled_from([-90.0, 80.0, 88.0, 90.0, 80.001, -90.001, 1e6, math.inf, -math.inf, math.nan]),
    st.floats(allow_nan=True, allow_infinity=True),
)


@dataclass
class Plant:
    """A stage and what is behind it; `motor` is None where stage and motor are one.

    `position_deg` is the true angle; `moves` counts the moves begun.
    """

    stage: Stage
    clock: SimulatedClock
    position_deg: Callable[[], float]
    moves: Callable[[], int]
    motor: Motor | None = None
    alarm: str = ""


def plant_of(kind: str, patch: pytest.MonkeyPatch) -> Plant:
    if kind == "simulated":
        axis, clock = DEMO.rig.axes.theta_r, SimulatedClock()
        assert isinstance(axis, SimulatedAxis)
        stage = SimulatedStage("theta_r", axis, Scene.of(DEMO.rig, DEMO.protocol), clock)
        return Plant(stage, clock, stage.position_deg, lambda: 0)
    # Limits that a controller does not keep itself must be in the rig file.
    limits = LIMITS if KINDS[kind].keeps_limits else replace(LIMITS, max_deg=MECHANICS.max_deg)
    found = in_memory(kind, patch, MECHANICS, limits)
    motor = found.motor
    return Plant(
        found.open(), found.clock, lambda: motor.position_deg, found.moves, motor, found.alarm
    )


class StageMachine(RuleBasedStateMachine):
    """A stage, its operator, and what can happen to it; the motor knows the true position.

    `held_deg`: where it must stay, because its reference is not known or it has a fault.
    """

    kind = ""

    def __init__(self) -> None:
        super().__init__()
        self._open = ExitStack()

    @initialize()
    def plug_in(self) -> None:
        self.plant = plant_of(self.kind, self._open.enter_context(pytest.MonkeyPatch.context()))
        self.stage, self.motor = self.plant.stage, self.plant.motor
        self.low_deg, self.high_deg = self.stage.limits_deg()
        self.known = self.fault = self.disturbed = False
        self.target_deg: float | None = None
        self._stays()

    def teardown(self) -> None:
        if hasattr(self, "plant"):
            self.stage.stop()
            begun = self.plant.moves()
            self.stage.close()
            self.stage.close()
            if self.kind != "simulated":
                with pytest.raises(DeviceError):
                    self.stage.start_move(0.0)
            assert self.plant.moves() == begun
        self._open.close()

    def _stays(self) -> None:
        self.held_deg: float | None = self.plant.position_deg()
        self.held_moves = self.plant.moves()

    @property
    def _may_move(self) -> bool:
        return self.known and not self.fault

    @property
    def _busy(self) -> bool:
        """Whether it moves: asked of where it is, a moment later."""
        here_deg = self.plant.position_deg()
        self.plant.clock.sleep(1e-3)
        return self.plant.position_deg() != here_deg or bool(self.motor and self.motor.moving)

    def _stands(self) -> None:
        here_deg = self.plant.position_deg()
        self.plant.clock.sleep(30.0)
        assert self.plant.position_deg() == here_deg

    @rule()
    def home(self) -> None:
        busy = self._busy
        try:
            self.stage.home()
        except DeviceError:
            assert self.fault or busy
            self.disturbed |= busy  # what it is asked to do while it moves may be refused
            return
        assert not self.fault
        self.known, self.held_deg, self.target_deg = True, None, None
        assert self.plant.position_deg() == pytest.approx(HOME_DEG, abs=TOLERANCE_DEG)

    @rule(angle_deg=ANGLES_DEG)
    def start_move(self, angle_deg: float) -> None:
        busy, begun, here_deg = self._busy, self.plant.moves(), self.plant.position_deg()
        inside = self.low_deg - 1e-9 <= angle_deg <= self.high_deg + 1e-9
        try:
            self.stage.start_move(angle_deg)
        except DeviceError:
            assert busy or not (inside and self._may_move)
            assert self.plant.moves() == begun
            assert busy or self.plant.position_deg() == here_deg
            self.disturbed |= busy
            return
        assert inside
        assert self._may_move
        self.target_deg, self.disturbed = angle_deg, False

    @rule()
    def wait(self) -> None:
        try:
            said_deg = self.stage.wait()
        except DeviceError:
            assert self.disturbed or not self._may_move
        else:
            assert said_deg == pytest.approx(self.plant.position_deg(), abs=TOLERANCE_DEG)
            if self.target_deg is not None and not self.disturbed:
                assert said_deg == pytest.approx(self.target_deg, abs=TOLERANCE_DEG)
        self.target_deg, self.disturbed = None, False
        self._stands()

    @rule(times=st.integers(1, 2))
    def stop(self, times: int) -> None:
        """At any time, and twice."""
        for _ in range(times):
            self.stage.stop()
        self.disturbed = True
        self._stands()

    @rule()
    def position(self) -> None:
        try:
            said_deg = self.stage.position_deg()
        except DeviceError:
            assert not self._may_move
        else:
            assert said_deg == pytest.approx(self.plant.position_deg(), abs=TOLERANCE_DEG)

    @rule(seconds=st.floats(0.0, 0.2))
    def time_passes(self, seconds: float) -> None:
        self.plant.clock.sleep(seconds)

    @precondition(lambda self: self.motor is not None)
    @rule()
    def fail(self) -> None:
        """An alarm of the controller, which stays until somebody clears it there."""
        self.motor.fail(self.plant.alarm)
        self.fault = self.disturbed = True
        self._stays()

    @precondition(lambda self: self.fault)
    @rule()
    def clear(self) -> None:
        self.motor.alarm, self.fault = "", False
        if self.known:
            self.held_deg = None

    @precondition(lambda self: self.motor is not None)
    @rule()
    def lose_reference(self) -> None:
        """The controller's power was off for a moment."""
        self.motor.lose_power()
        self.known = False
        self.disturbed = True
        self._stays()

    @precondition(lambda self: self.motor is not None and self.motor.moving)
    @rule()
    def hold(self) -> None:
        """Something is in the way."""
        self.motor.hold()
        self.disturbed = True

    @invariant()
    def the_clock_was_read_a_limited_number_of_times(self) -> None:
        if hasattr(self, "plant") and isinstance(self.plant.clock, CountingClock):
            self.plant.clock.readings = 0  # it raises past its limit

    @invariant()
    def within_the_narrower_limits(self) -> None:
        if hasattr(self, "plant"):
            here_deg = self.plant.position_deg()
            assert self.low_deg - TOLERANCE_DEG <= here_deg <= self.high_deg + TOLERANCE_DEG

    @invariant()
    def what_must_stay_stays(self) -> None:
        if hasattr(self, "plant") and self.held_deg is not None:
            assert self.plant.position_deg() == self.held_deg
            assert self.plant.moves() == self.held_moves


@pytest.mark.slow
@pytest.mark.parametrize("kind", STAGES)
def test_random_sequences_never_move_a_stage_that_must_stay(kind: str, slow: bool) -> None:
    machine: Any = type(f"{kind.title()}Machine", (StageMachine,), {"kind": kind})
    examples, steps = (1500, 50) if slow else (40, 20)
    run_state_machine_as_test(
        machine,
        settings=settings(max_examples=examples, stateful_step_count=steps, derandomize=not slow),
    )
