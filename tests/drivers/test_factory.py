"""Factory of drivers: every kind can be opened, and axes on one port share its line."""

from __future__ import annotations

from contextlib import closing
from typing import get_args

import pytest

from drivers.factory import Lines, open_stage
from instrument.clock import SystemClock
from instrument.config.axes import EMULATED, NewportAxis, Wired
from instrument.config.load import load_rig
from instrument.config.rig import Rig
from sim.emulated.bench import EmulatedBench
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.newport_controller import NewportController
from sim.emulated.wire import PtyWire
from sim.scene.scene import Scene
from tests.support.paths import CONFIGS


@pytest.fixture
def emulated() -> Rig:
    return load_rig(CONFIGS / "rigs" / "emulated.yaml")


def newport_axis(port: str, address: int) -> NewportAxis:
    return NewportAxis(
        driver="newport", port=port, address=address, min_deg=-90.0, max_deg=90.0, u_deg=0.01,
        speed_deg_per_s=20.0, acceleration_deg_per_s2=40.0, settle_s=0.0,
    )  # fmt: skip


def test_axes_on_one_port_share_its_line() -> None:
    motors = [Motor(Mechanics(), SystemClock()) for _ in range(2)]
    controllers = [NewportController(motor, n) for n, motor in enumerate(motors, start=1)]
    with PtyWire(controllers) as wire, Lines(SystemClock()) as lines:
        for number in (1, 2):
            stage = open_stage("axis", newport_axis(wire.port, number), wire.port, lines)
            assert stage.identity().endswith(f"address {number}")


def axis_of(kind: type[Wired]) -> Wired:
    """An axis of this kind with its settings left out where they may be; others are numbers."""
    given = {
        "driver": get_args(kind.model_fields["driver"].annotation)[0],
        "port": EMULATED, "min_deg": -90.0, "max_deg": 90.0, "u_deg": 0.01,
        "speed_deg_per_s": 20.0, "acceleration_deg_per_s2": 40.0, "settle_s": 0.0,
    }  # fmt: skip
    needed = {name for name, field in kind.model_fields.items() if field.is_required()}
    return kind.model_validate(dict.fromkeys(needed, 1000.0) | given)


@pytest.mark.parametrize("kind", get_args(Wired))
def test_every_kind_of_driver_opens_on_its_emulated_controller(
    kind: type[Wired], emulated: Rig
) -> None:
    axis, scene = axis_of(kind), Scene.of_white_sample(emulated)
    with closing(EmulatedBench(scene, SystemClock())) as bench, Lines(SystemClock()) as lines:
        assert open_stage("axis", axis, bench.plug_axis("axis", axis), lines).identity()


def test_a_kind_without_a_driver_is_an_error() -> None:
    with Lines(SystemClock()) as lines, pytest.raises(AssertionError, match="unreachable"):
        open_stage("axis", object(), "port", lines)  # type: ignore[arg-type]  # no kind
