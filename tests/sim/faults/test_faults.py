"""Faults planned in words (`GONIO_FAULTS`); their effect on a scan: `tests.system.faults`."""

from __future__ import annotations

import pytest

from acquisition.rig import open_devices
from instrument.config.load import Loaded
from instrument.errors import DeviceError, InputError
from sim.faults.faults import VARIABLE, Faults
from tests.support.scans import small_scan


@pytest.fixture(scope="module")
def small() -> Loaded:
    return small_scan()


@pytest.mark.parametrize(
    "text", ["theta_r explodes at theta_r.wait 5", "theta_r stalls", "lamp sticks at lamp.light 0"]
)
def test_an_unknown_fault_is_refused_with_a_list_of_known_ones(text: str) -> None:
    with pytest.raises(InputError, match=r"allowed: DEVICE FAULT at\|after.*meets its limit"):
        Faults(text)


def test_faults_come_from_the_environment_only(
    small: Loaded, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert Faults.from_environment() is None
    monkeypatch.setenv(VARIABLE, "camera is unplugged at camera.grab 1")
    with pytest.raises(DeviceError, match="camera: not found"):
        open_devices(small).camera.grab(1)


def test_a_fault_of_the_world_has_a_size_and_may_pass(small: Loaded) -> None:
    faults = Faults("world lamp 0.5 at camera.grab 2; world lamp 1 after camera.grab 2")
    camera = open_devices(small, faults).camera
    assert faults.scene is not None
    faults.scene.lit = True
    for axis in ("theta_i", "dphi", "theta_r"):
        faults.scene.set_axis(axis, 0.0)
    camera.set_exposure_s(0.02)
    before, dim, after = (camera.grab(1)[0].image.mean() for _ in range(3))
    assert dim < 0.6 * before
    assert after == pytest.approx(before, rel=0.01)


@pytest.mark.parametrize(
    ("fault", "wrong"), [("lamp", "could not convert"), ("sun 1", "no fault 'sun'; allowed: lamp")]
)
def test_a_wrong_fault_of_the_world_is_refused(fault: str, wrong: str) -> None:
    with pytest.raises(InputError, match=wrong):
        Faults(f"world {fault} at camera.grab 2")
