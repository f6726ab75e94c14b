"""Contract of every stage: simulated, each driver on its emulated controller, and real ones.

Real stages are tested only with `--allow-motion --rig FILE`: every motor of the rig file, or those
that `--axis NAME` names, by their own settings. Each homes, and moves within 10 degrees of home, at
the rig file's speed. Keep-out zones are not checked: the other axes are not read.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import pytest

from drivers.factory import Lines, open_stage
from drivers.lines.serial_line import PortGone
from instrument.clock import Clock, SystemClock
from instrument.config.axes import AXES, SimulatedAxis, Wired
from instrument.config.load import load_protocol, load_rig
from instrument.devices import Stage
from instrument.errors import DeviceError
from sim.clock import SimulatedClock
from sim.scene.scene import Scene
from sim.scene.stage import SimulatedStage
from tests.support.paths import CONFIGS
from tests.support.stages.emulated_stages import EMULATED_STAGES, LIMITS

pytestmark = pytest.mark.waits

REACH_DEG = 10.0  # how far from home a real stage is moved


@dataclass(frozen=True)
class StageUnderTest:
    """A stage, where its home is, how far from its target it may stop, and its full speed."""

    stage: Stage
    home_deg: float
    tolerance_deg: float
    full_deg_per_s: float
    clock: Clock = field(default_factory=SystemClock)

    def at(self, share: float) -> float:
        """Return an angle at a share of the reach on the side of home that has more room."""
        low, high = self.stage.limits_deg()
        up = high - self.home_deg >= self.home_deg - low
        room_deg = high - self.home_deg if up else self.home_deg - low
        return self.home_deg + share * min(REACH_DEG, room_deg) * (1 if up else -1)

    def homed(self) -> Stage:
        self.stage.home()
        return self.stage

    def near(self, angle_deg: float) -> object:
        return pytest.approx(angle_deg, abs=self.tolerance_deg)


@contextmanager
def simulated() -> Iterator[StageUnderTest]:
    loaded = load_protocol(CONFIGS / "protocols" / "demo.yaml")
    axis = loaded.rig.axes.theta_r
    assert isinstance(axis, SimulatedAxis)
    scene = Scene.of(loaded.rig, loaded.protocol)
    clock = SimulatedClock()
    stage = SimulatedStage("theta_r", axis, scene, clock)
    home_deg = axis.to_device_deg(axis.home_deg)
    # It has errors of its own.
    yield StageUnderTest(stage, home_deg, 0.05, axis.speed_deg_per_s, clock)


@contextmanager
def real(name: str, config: pytest.Config) -> Iterator[StageUnderTest]:
    """An axis of the rig file, opened as a scan opens it."""
    axis = load_rig(config.getoption("--rig")).axes[name]
    assert isinstance(axis, Wired)
    with Lines(SystemClock()) as lines:
        stage = open_stage(name, axis, axis.port, lines)
        try:
            home_deg = axis.to_device_deg(axis.home_deg)
            yield StageUnderTest(stage, home_deg, axis.tolerance_deg, axis.speed_deg_per_s)
        finally:
            try:
                stage.stop()
            except PortGone as gone:
                if "it was closed" not in str(gone):  # by the test itself
                    raise


def real_axes(config: pytest.Config) -> list[str]:
    """Motors of the rig file, or those of them that `--axis` names."""
    path, wanted = config.getoption("--rig"), config.getoption("--axis")
    if path is None:
        return []
    axes = load_rig(path).axes
    motors = [n for n in AXES if isinstance(axis := axes[n], Wired) and axis.port != "emulated"]
    if unknown := set(wanted or ()) - set(motors):
        raise pytest.UsageError(f"--axis {' '.join(unknown)}: {path} has the motors {motors}")
    return wanted or motors


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Add the real axes that the options name."""
    named = [f"real {name}" for name in real_axes(metafunc.config)] or ["no real stage"]
    stages = [
        "simulated",
        *EMULATED_STAGES,
        *(pytest.param(n, marks=pytest.mark.hil) for n in named),
    ]
    metafunc.parametrize("tested", stages, indirect=True)


@pytest.fixture
def tested(request: pytest.FixtureRequest) -> Iterator[StageUnderTest]:
    if request.param == "simulated":
        with simulated() as tested:
            yield tested
    elif request.param == "no real stage":
        pytest.skip("no real stage: --allow-motion --rig FILE, with a motor in it")
    elif request.param.startswith("real "):
        with real(request.param.removeprefix("real "), request.config) as tested:
            yield tested
    else:
        with EMULATED_STAGES[request.param]() as emulated:
            full = LIMITS.speed_deg_per_s
            yield StageUnderTest(emulated.stage, LIMITS.home_deg, LIMITS.tolerance_deg, full)


def test_identity_is_stable(tested: StageUnderTest) -> None:
    assert len(tested.stage.identity()) > 10
    assert tested.stage.identity() == tested.stage.identity()


def test_limits_are_in_order(tested: StageUnderTest) -> None:
    low, high = tested.stage.limits_deg()
    assert low < high
    assert low <= tested.home_deg <= high


def test_homing_ends_at_home(tested: StageUnderTest) -> None:
    assert tested.homed().position_deg() == tested.near(tested.home_deg)


def test_moves_end_at_their_targets(tested: StageUnderTest) -> None:
    stage = tested.homed()
    low, high = stage.limits_deg()
    for share in (0.2, -0.3, -0.3, 0.95, 0.951, 0.0):
        angle_deg = min(max(tested.at(share), low), high)
        stage.start_move(angle_deg)
        assert stage.wait() == tested.near(angle_deg)
        assert stage.position_deg() == tested.near(angle_deg)


def test_a_move_past_a_limit_is_refused(tested: StageUnderTest) -> None:
    stage = tested.homed()
    low, high = stage.limits_deg()
    here = stage.position_deg()
    for angle_deg in (low - 0.01, high + 0.01, 1e6, float("nan")):
        with pytest.raises(DeviceError, match=r"asked for; its limits are"):
            stage.start_move(angle_deg)
    assert stage.position_deg() == tested.near(here)


def test_a_stop_is_allowed_at_any_time(tested: StageUnderTest) -> None:
    tested.stage.stop()
    tested.stage.stop()
    stage = tested.homed()
    stage.stop()
    stage.start_move(tested.at(0.5))
    assert stage.wait() == tested.near(tested.at(0.5))
    stage.stop()
    assert stage.position_deg() == tested.near(tested.at(0.5))


def test_a_stop_ends_a_move_before_its_target(tested: StageUnderTest) -> None:
    stage = tested.homed()
    stage.start_move(tested.at(0.9))
    stage.stop()
    assert stage.position_deg() == tested.near(stage.position_deg())  # it stands
    try:
        where = stage.wait()
    except DeviceError:
        where = stage.position_deg()
    assert abs(where - tested.home_deg) < abs(tested.at(0.9) - tested.home_deg)
    stage.start_move(tested.at(0.1))  # the next move is possible
    assert stage.wait() == tested.near(tested.at(0.1))


def test_positions_during_a_move_at_a_set_speed_lie_on_one_line(tested: StageUnderTest) -> None:
    """What a scan with `motion: fly` relies on: each position is of a time within its exchange."""
    stage, clock, speed = tested.homed(), tested.clock, min(20.0, tested.full_deg_per_s / 4)
    stage.set_speed(speed)
    target_deg = tested.at(0.9)
    way_deg, seen = target_deg - tested.home_deg, []
    stage.start_move(target_deg)
    until_s = clock.now_s() + 2 * abs(way_deg) / speed + 2.0
    while clock.now_s() < until_s:
        before_s = clock.now_s()
        share = (stage.position_deg() - tested.home_deg) / way_deg
        seen.append((before_s, clock.now_s(), share))
        if share > 0.9:
            break
        clock.sleep(0.005)
    assert stage.wait() == tested.near(target_deg)
    steady = [one for one in seen if 0.2 < one[2] < 0.8]  # away from both ramps
    assert len(steady) >= 5
    before_s, after_s, shares = np.array(steady).T
    turned_deg = abs(way_deg) * shares
    assert np.max(turned_deg - speed * after_s) <= np.min(turned_deg - speed * before_s) + 0.1
    stage.set_speed(tested.full_deg_per_s)


def test_a_speed_beyond_the_rig_file_s_is_refused(tested: StageUnderTest) -> None:
    stage, full = tested.homed(), tested.full_deg_per_s
    for speed in (0.0, -1.0, 1.01 * full, float("nan")):
        with pytest.raises(DeviceError, match=r"deg/s asked for; allowed: more than 0, up to"):
            stage.set_speed(speed)
    stage.set_speed(full)
    stage.start_move(tested.at(0.2))
    assert stage.wait() == tested.near(tested.at(0.2))


def test_waiting_without_a_move_returns_the_position(tested: StageUnderTest) -> None:
    assert tested.homed().wait() == tested.near(tested.home_deg)


def test_closing_twice_is_allowed(tested: StageUnderTest) -> None:
    tested.stage.close()
    tested.stage.close()
