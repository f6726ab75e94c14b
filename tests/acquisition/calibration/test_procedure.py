"""Procedure of a camera's calibration: what it asks of lamp, operator and camera, and when."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from acquisition.calibration import checks
from acquisition.calibration.plan import CalibrationPlan
from acquisition.calibration.procedure import CameraCalibrator
from acquisition.rig import OpenRig
from instrument.devices import Frame, Request
from instrument.errors import DeviceError, OperatorStop
from tests.support.scans import small_scan


@dataclass
class Recorder:
    """Operator, lamp and camera of a rig, all calls noted."""

    rig: OpenRig
    refuses: bool = False
    calls: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.inner = self.rig.camera()

    def ask(self, request: Request) -> str:
        self.calls.append(request.action)
        if self.refuses:
            raise OperatorStop("no")
        return self.rig.operator.ask(request)

    def identity(self) -> str:
        return "recorder"

    def darken(self) -> None:
        self.calls.append("darken")
        self.rig.lamp.darken()

    def light(self) -> None:
        self.calls.append("light")
        self.rig.lamp.light()

    def settings(self) -> dict[str, str]:
        return {}

    def set_exposure_s(self, exposure_s: float) -> float:
        return self.inner.set_exposure_s(exposure_s)

    def grab(self, count: int) -> list[Frame]:
        self.calls.append("grab")
        return self.inner.grab(count)

    def close(self) -> None:
        self.inner.close()


def calibrator(rig: OpenRig, devices: Recorder) -> CameraCalibrator:
    plan = CalibrationPlan(rig=small_scan().rig, exposures=14, frames=2)
    return CameraCalibrator(
        plan=plan, camera=devices, lamp=devices, operator=devices, say=lambda _: None
    )


def test_the_lamp_is_covered_once() -> None:
    with OpenRig(small_scan().rig, white_mm=200.0) as rig:
        rig.pose_scene(0.0)
        devices = Recorder(rig)
        measured = calibrator(rig, devices).measure()
    order = [call for call in devices.calls if call != "grab"]
    assert order == ["place", "light", "darken", "light"]
    dark = devices.calls.index("darken")
    lit = devices.calls.index("light", dark)
    assert devices.calls[dark:lit].count("grab") == 6
    assert measured.dark.mean_dn == pytest.approx(64, abs=8)
    assert measured.lit.mean_dn[-1] > 4000
    # No order of rising or falling exposures, which a drift of the lamp would imitate.
    assert abs(np.corrcoef(measured.lit.exposure_s, measured.lit.age_s)[0, 1]) < 0.6


def test_an_operator_who_refuses_ends_it_before_any_frame() -> None:
    with OpenRig(small_scan().rig) as rig:
        devices = Recorder(rig, refuses=True)
        with pytest.raises(OperatorStop):
            calibrator(rig, devices).measure()
    assert devices.calls == ["place"]


def test_no_axis_is_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: OpenRig, name: str) -> None:
        raise AssertionError(name)

    monkeypatch.setattr(OpenRig, "axis", refuse)
    with OpenRig(small_scan().rig, white_mm=200.0) as rig:
        rig.pose_scene(0.0)
        calibrator(rig, Recorder(rig)).measure()


def test_a_camera_that_takes_one_exposure_for_several_is_named() -> None:
    with pytest.raises(DeviceError, match=r"asked for exposures of 0.1, 0.2 s and took 0.1 s"):
        checks.require_exposures([0.1, 0.2], [0.1])
    checks.require_exposures([0.1, 0.2], [0.1, 0.19])
