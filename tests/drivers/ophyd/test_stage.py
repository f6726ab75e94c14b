"""A motor of ophyd-async is an axis: limits, moves, verified stops, and refusals that say why."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from pydantic import ValidationError

from acquisition.rig import OpenRig
from drivers.factory import open_ophyd
from drivers.stages.motor_stage import MotorStage
from instrument.clock import SystemClock
from instrument.config.axes import OphydAxis
from instrument.config.load import load_rig
from instrument.errors import DeviceError
from tests.support.facility.stopped_move import stopped_position_deg
from tests.support.paths import CONFIGS

pytest.importorskip("ophyd_async", reason="ophyd-async is not installed")
MOTORS = "tests.support.facility.ophyd_motors"


def axis(motor: str = f"{MOTORS}:FastMotor", speed: float = 400.0) -> OphydAxis:
    return OphydAxis(
        driver="ophyd", motor=motor, min_deg=-90.0, max_deg=90.0, u_deg=0.01, settle_s=0.0,
        speed_deg_per_s=speed, acceleration_deg_per_s2=100 * speed,
    )  # fmt: skip


def opened(motor: OphydAxis) -> MotorStage:
    return open_ophyd("theta_r", motor, SystemClock())


@pytest.fixture
def stage() -> Iterator[MotorStage]:
    with closing(opened(axis())) as own:
        yield own


def test_moves_end_where_they_were_sent(stage: MotorStage) -> None:
    rng = random.Random(5)
    stage.home()
    assert stage.homed()
    for _ in range(4):
        angle_deg = rng.uniform(-60.0, 60.0)
        stage.start_move(angle_deg)
        assert stage.wait() == pytest.approx(angle_deg, abs=1e-6)
        assert stage.position_deg() == pytest.approx(angle_deg, abs=1e-6)
    assert stage.identity() == f"ophyd-async motor {MOTORS}:FastMotor"


def test_limits_of_the_rig_file_hold(stage: MotorStage) -> None:
    with pytest.raises(DeviceError, match=r"95 deg"):
        stage.start_move(95.0)
    assert stage.position_deg() == 0.0


def test_a_stop_from_another_thread_ends_a_move_and_the_next_one_begins() -> None:
    with closing(opened(axis(speed=20.0))) as stage:
        stage.home()
        at_deg = stopped_position_deg(stage, 80.0)
        assert at_deg < 40.0
        stage.start_move(at_deg + 0.5)
        assert stage.wait() == pytest.approx(at_deg + 0.5)


@pytest.mark.parametrize(
    ("motor", "said"),
    [
        ("no_such_module:Motor", "allowed: module:Class that Python can import"),
        (f"{MOTORS}:Nothing", "allowed: module:Class that Python can import"),
        ("os:system", "is no motor; allowed: a class derived from StandardMovable"),
        ("pathlib:Path", "is no motor"),
        (f"{MOTORS}:LinearMotor", "counts in 'mm'; allowed: a motor that counts in degrees"),
    ],
)
def test_what_is_no_rotary_motor_is_refused(motor: str, said: str) -> None:
    with pytest.raises(DeviceError, match="theta_r: ") as refused:
        opened(axis(motor))
    assert said in str(refused.value)


def test_a_rig_file_names_a_motor_and_its_axis_keeps_zero_sign_and_limits(tmp_path: Path) -> None:
    text = (CONFIGS / "rigs" / "emulated.yaml").read_text()
    text = text.replace("device: emulated", "device: /dev/video9")
    text = text.replace(
        "driver: simulated\n  darkened_by: shutter", "driver: manual\n  darkened_by: hand"
    )
    text = re.sub(r"port: emulated, ", "port: /dev/ttyS9, ", text, count=1)
    text = text.replace("{driver: oriental, port: emulated, parity: N, steps_per_deg: 1000.0,",
                        "{driver: hand,").replace("max_deg: 181.0, speed_deg_per_s: 1000.0, "
                        "acceleration_deg_per_s2: 20000.0, settle_s: 0.0,\n     homing_s: 2.0,",
                        "max_deg: 181.0,")  # fmt: skip
    path = tmp_path / "rig.yaml"
    path.write_text(
        text.replace(
            "{driver: zaber, port: emulated, microsteps_per_deg: 4266.666667,",
            f"{{driver: ophyd, motor: '{MOTORS}:FastMotor', prefix: BENCH-MO-01, zero_deg: 5.0, "
            "sign: -1,",
        ).replace("speed_deg_per_s: 1000.0, acceleration_deg_per_s2: 20000.0, settle_s: 0.0, "
                  "homing_s: 2.0,\n     backlash", "speed_deg_per_s: 400.0, "
                  "acceleration_deg_per_s2: 40000.0, settle_s: 0.0,\n     backlash")
    )  # fmt: skip
    rig = load_rig(path)
    assert rig.real
    with OpenRig(rig) as opened_rig:
        own = opened_rig.axis("theta_r")
        own.home()
        own.start_move(20.0)
        own.finish_move()
        assert own.position_deg() == pytest.approx(20.0)
        assert own.identity().endswith("FastMotor at BENCH-MO-01")
        with pytest.raises(DeviceError, match=r"theta_r: 88\.5 deg is outside the rig's limits"):
            own.start_move(88.5)


@pytest.mark.parametrize("motor", ["os.system", "a:b(c)", "../evil:Motor", ":Motor", "a:"])
def test_a_path_that_names_no_class_is_refused_in_the_file(motor: str) -> None:
    with pytest.raises(ValidationError):
        axis(motor)
