"""Motion behind the emulated controllers, in simulated time."""

from __future__ import annotations

import pytest

from sim.clock import SimulatedClock
from sim.emulated.motor import Mechanics, Motor


def homed(clock: SimulatedClock) -> Motor:
    motor = Motor(Mechanics(), clock)
    motor.home()
    clock.sleep(motor.mechanics.homing_s)
    return motor


def test_homing_ends_at_the_home_position_with_a_reference() -> None:
    clock = SimulatedClock()
    motor = Motor(Mechanics(), clock)
    assert motor.position_deg != motor.mechanics.home_deg
    motor.home()
    assert motor.homing
    assert not motor.referenced
    clock.sleep(motor.mechanics.homing_s)
    assert motor.position_deg == motor.mechanics.home_deg
    assert motor.referenced


def test_homing_that_fails_never_ends() -> None:
    clock = SimulatedClock()
    motor = Motor(Mechanics(), clock)
    motor.homing_fails = True
    motor.home()
    clock.sleep(1e6)
    assert motor.homing


def test_a_held_axis_never_arrives_and_a_stop_releases_it() -> None:
    clock = SimulatedClock()
    motor = homed(clock)
    motor.move(50.0)  # 20 deg/s at 40 deg/s^2: 3 s
    clock.sleep(1.5)
    motor.hold()
    clock.sleep(60.0)
    assert motor.moving
    assert motor.position_deg == pytest.approx(25.0)
    motor.stop()
    assert not motor.moving
    motor.move(50.0)
    clock.sleep(10.0)
    assert motor.position_deg == pytest.approx(50.0)


def test_a_stopped_axis_brakes_by_the_set_acceleration() -> None:
    clock = SimulatedClock()
    motor = homed(clock)
    motor.move(-50.0)  # at -20 deg/s
    clock.sleep(1.5)
    motor.stop()
    clock.sleep(0.49)
    assert motor.moving
    clock.sleep(0.02)
    assert not motor.moving
    assert motor.position_deg == pytest.approx(-25.0 - 20.0**2 / (2 * 40.0))


def test_a_power_failure_stops_the_axis_and_loses_the_reference() -> None:
    clock = SimulatedClock()
    motor = homed(clock)
    motor.move(50.0)
    clock.sleep(1.5)
    motor.lose_power()
    assert (motor.moving, motor.referenced) == (False, False)
    assert motor.position_deg == pytest.approx(25.0)
