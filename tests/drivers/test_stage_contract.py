"""Contract of every stage: simulated, each driver on its emulated controller, and a real one.

A real stage is tested only with `--allow-motion --stage-port PORT`; it then moves within 10 degrees
of home.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from drivers.factory import Lines, open_stage
from instrument.clock import SystemClock
from instrument.config.axes import NewportAxis, OrientalAxis, SimulatedAxis, Wired, ZaberAxis
from instrument.config.load import load_protocol
from instrument.devices import Stage
from instrument.errors import DeviceError
from sim.clock import SimulatedClock
from sim.scene.scene import Scene
from sim.scene.stage import SimulatedStage
from tests.support.paths import CONFIGS
from tests.support.stages.emulated_stages import EMULATED_STAGES

pytestmark = pytest.mark.waits

TOLERANCE_DEG = 0.05  # of a real stage
KEYS = {
    "min_deg": -10.0, "max_deg": 10.0, "u_deg": 0.01, "speed_deg_per_s": 5.0,
    "acceleration_deg_per_s2": 5.0, "settle_s": 0.0, "homing_s": 120.0,
}  # fmt: skip


@contextmanager
def simulated() -> Iterator[Stage]:
    loaded = load_protocol(CONFIGS / "protocols" / "demo.yaml")
    axis = loaded.rig.axes.theta_r
    assert isinstance(axis, SimulatedAxis)
    scene = Scene.of(loaded.rig, loaded.protocol)
    yield SimulatedStage("theta_r", axis, scene, SimulatedClock())


@contextmanager
def real(config: pytest.Config) -> Iterator[Stage]:
    """The stage at `--stage-port`."""
    port, scale = config.getoption("--stage-port"), config.getoption("--stage-scale")
    axis: Wired
    match config.getoption("--stage-driver"):
        case "newport":
            axis = NewportAxis(driver="newport", port=port, **KEYS)
        case "zaber":
            axis = ZaberAxis(driver="zaber", port=port, microsteps_per_deg=scale, **KEYS)
        case "oriental":
            axis = OrientalAxis(driver="oriental", port=port, steps_per_deg=scale, **KEYS)
        case other:
            pytest.fail(f"--stage-driver {other}: no such driver")
    with Lines(SystemClock()) as lines:
        stage = open_stage("stage", axis, port, lines)
        try:
            yield stage
        finally:
            stage.stop()


@pytest.fixture(params=["simulated", *EMULATED_STAGES, pytest.param("real", marks=pytest.mark.hil)])
def stage(request: pytest.FixtureRequest) -> Iterator[Stage]:
    if request.param == "simulated":
        with simulated() as stage:
            yield stage
    elif request.param == "real":
        if not request.config.getoption("--stage-port"):
            pytest.skip("no real stage: --allow-motion --stage-port PORT")
        with real(request.config) as stage:
            yield stage
    else:
        with EMULATED_STAGES[request.param]() as emulated:
            yield emulated.stage


def test_identity_is_stable(stage: Stage) -> None:
    assert len(stage.identity()) > 10
    assert stage.identity() == stage.identity()


def test_limits_are_in_order(stage: Stage) -> None:
    low, high = stage.limits_deg()
    assert low < 0 < high


def test_homing_ends_at_home(stage: Stage) -> None:
    stage.home()
    assert stage.position_deg() == pytest.approx(0.0, abs=TOLERANCE_DEG)


def test_moves_end_at_their_targets(stage: Stage) -> None:
    stage.home()
    for angle_deg in (2.0, -3.0, -3.0, 9.5, 9.51, 0.0):
        stage.start_move(angle_deg)
        assert stage.wait() == pytest.approx(angle_deg, abs=TOLERANCE_DEG)
        assert stage.position_deg() == pytest.approx(angle_deg, abs=TOLERANCE_DEG)


def test_a_move_past_a_limit_is_refused(stage: Stage) -> None:
    stage.home()
    low, high = stage.limits_deg()
    here = stage.position_deg()
    for angle_deg in (low - 0.01, high + 0.01, 1e6, float("nan")):
        with pytest.raises(DeviceError, match=r"asked for; its limits are"):
            stage.start_move(angle_deg)
    assert stage.position_deg() == pytest.approx(here, abs=1e-6)


def test_a_stop_is_allowed_at_any_time(stage: Stage) -> None:
    stage.stop()
    stage.stop()
    stage.home()
    stage.stop()
    stage.start_move(5.0)
    assert stage.wait() == pytest.approx(5.0, abs=TOLERANCE_DEG)
    stage.stop()
    assert stage.position_deg() == pytest.approx(5.0, abs=TOLERANCE_DEG)


def test_a_stop_ends_a_move_before_its_target(stage: Stage) -> None:
    stage.home()
    stage.start_move(9.0)
    stage.stop()
    try:
        where = stage.wait()
    except DeviceError:
        where = stage.position_deg()
    assert where < 9.0
    stage.start_move(1.0)  # the next move is possible
    assert stage.wait() == pytest.approx(1.0, abs=TOLERANCE_DEG)


def test_waiting_without_a_move_returns_the_position(stage: Stage) -> None:
    stage.home()
    assert stage.wait() == pytest.approx(0.0, abs=TOLERANCE_DEG)


def test_closing_twice_is_allowed(stage: Stage) -> None:
    stage.close()
    stage.close()
