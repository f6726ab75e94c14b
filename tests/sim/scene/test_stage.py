"""The simulated stage; what every stage must do is in `tests.drivers.test_stage_contract`."""

from __future__ import annotations

import pytest

from instrument.config.axes import SimulatedAxis
from instrument.config.load import Loaded
from instrument.errors import DeviceError
from sim.clock import SimulatedClock
from sim.scene.scene import Scene
from sim.scene.stage import SimulatedStage
from tests.support.scans import simulated_scene


def stage_of(loaded: Loaded, **changes: float) -> tuple[SimulatedStage, SimulatedClock, Scene]:
    axis = loaded.rig.axes.theta_r
    assert isinstance(axis, SimulatedAxis)
    clock, scene = SimulatedClock(), simulated_scene(loaded)
    return SimulatedStage("theta_r", axis.model_copy(update=changes), scene, clock), clock, scene


def test_a_move_takes_the_time_of_its_kinematics(demo: Loaded) -> None:
    stage, clock, _ = stage_of(demo)
    stage.home()
    start_s = clock.now_s()
    stage.start_move(50.0)  # 20 deg/s at 40 deg/s^2: 3 s
    assert clock.now_s() == start_s
    assert stage.wait() == pytest.approx(50.0)
    assert clock.now_s() - start_s == pytest.approx(3.0)


def test_no_move_before_homing_or_beyond_a_limit(demo: Loaded) -> None:
    stage, _, _ = stage_of(demo)
    with pytest.raises(DeviceError, match="theta_r: not homed"):
        stage.start_move(10.0)
    stage.home()
    with pytest.raises(DeviceError, match=r"88\.5 deg asked for; its limits are -88 to 88 deg"):
        stage.start_move(88.5)
    assert stage.wait() == 0.0


def test_a_stop_ends_the_move_at_the_current_position_and_may_be_repeated(demo: Loaded) -> None:
    stage, clock, _ = stage_of(demo)
    stage.home()
    stage.start_move(50.0)
    clock.sleep(1.5)
    stage.stop()
    stage.stop()
    assert stage.wait() == pytest.approx(25.0)


def test_zero_and_sign_convert_device_degrees_to_the_scene_s_angle(demo: Loaded) -> None:
    stage, _, scene = stage_of(demo, zero_deg=100.0, sign=-1, u_deg=0.0)
    stage.home()
    stage.start_move(70.0)
    assert stage.wait() == pytest.approx(70.0)
    assert scene.true_deg["theta_r"] == pytest.approx(30.0, abs=0.1)
