"""Devices of a rig satisfy bluesky's protocols, and keep to the rig file without a run engine."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

from acquisition.facility.devices.rig_devices import RigDevices, open_rig
from instrument.errors import DeviceError, InputError
from tests.support.paths import CONFIGS

PROTOCOLS = {
    "theta_r": "Movable Locatable Readable Stoppable Checkable Configurable Stageable HasHints "
    "HasParent NamedMovable",
    "camera": "Readable Triggerable Configurable Stageable HasHints HasParent",
    "lamp": "Movable Locatable Readable Stoppable Pausable Checkable Configurable HasHints "
    "HasParent NamedMovable",
}


@pytest.mark.parametrize("device", PROTOCOLS)
def test_a_device_satisfies_the_protocols(rig: RigDevices, device: str) -> None:
    protocols = pytest.importorskip("bluesky.protocols", reason="bluesky is not installed")
    for name in PROTOCOLS[device].split():
        protocols.check_supports(getattr(rig, device), getattr(protocols, name))
    if device != "lamp":  # an axis stands after a stop, and the camera takes no harm
        assert not isinstance(getattr(rig, device), protocols.Pausable)


def test_a_status_satisfies_the_protocol(rig: RigDevices) -> None:
    protocols = pytest.importorskip("bluesky.protocols", reason="bluesky is not installed")
    told: list[object] = []
    status = protocols.check_supports(rig.theta_r.stage(), protocols.Status)
    status.add_callback(told.append)
    assert status.exception(60.0) is None
    assert status.done
    assert status.success
    status.add_callback(told.append)
    assert told == [status, status]


def test_what_is_read_is_described_with_units(rig: RigDevices) -> None:
    rig.camera.stage().wait()
    rig.camera.trigger().wait()
    for device in (rig.theta_i, rig.dphi, rig.theta_r, rig.camera, rig.lamp):
        assert device.read().keys() == device.describe().keys()
        assert device.read_configuration().keys() == device.describe_configuration().keys()
        assert set(device.hints["fields"]) <= device.read().keys()
        for name, key in {**device.describe(), **device.describe_configuration()}.items():
            bare = key["dtype"] == "string" or name.endswith("frames")
            assert bare == ("units" not in key), name
    assert rig.theta_r.describe()["theta_r"]["units"] == "deg"
    assert rig.camera.describe()["camera_radiance"]["units"] == "DN/s"


def test_angles_are_those_of_the_rig_and_its_limits_hold(rig: RigDevices) -> None:
    rng = random.Random(24)
    rig.ready()
    for _ in range(10):
        angle = rng.uniform(-120.0, 120.0)
        before = rig.theta_r.locate()["readback"]
        status = rig.theta_r.set(angle)
        error = status.exception(60.0)
        if -87.0 < angle <= 87.5:  # from below, hence 0.5 deg before the limit of 88
            assert error is None
            rig.theta_r.check_value(angle)
            assert rig.theta_r.locate() == {
                "setpoint": angle,
                "readback": pytest.approx(angle, abs=1e-9),
            }
        else:
            assert isinstance(error, DeviceError | InputError)
            assert f"{angle:g}" in str(error)
            assert rig.theta_r.locate()["readback"] == before


def test_values_that_no_axis_takes_are_refused(rig: RigDevices) -> None:
    for wrong in (float("nan"), float("inf"), "30", None):
        value: Any = wrong
        with pytest.raises(InputError, match="allowed: a finite number of degrees"):
            rig.theta_r.set(value)
    with pytest.raises(InputError, match=r"theta_r: 88.5 deg; allowed: -88 to 88 deg"):
        rig.theta_r.check_value(88.5)
    with pytest.raises(InputError, match="lamp: 'on'; allowed: 'light' or 'dark'"):
        rig.lamp.set("on")
    with pytest.raises(InputError, match=r"exposure_s: 5.0; allowed: 0.0005 to 2 s"):
        rig.camera.exposure_s = 5.0


def test_a_rig_that_is_not_ready_does_not_move(rig: RigDevices) -> None:
    error = rig.theta_r.set(10.0).exception(60.0)
    assert isinstance(error, DeviceError)
    assert "nothing has moved: stage one of its devices" in str(error)
    with pytest.raises(DeviceError, match="no reading has been taken yet"):
        rig.camera.read()


def test_a_keep_out_zone_holds(rig: RigDevices) -> None:
    rig.ready()
    error = rig.theta_r.set(-87.2).exception(60.0)
    assert "keep-out zone 'cable post behind the table'" in str(error)
    assert rig.theta_r.locate()["readback"] == 0.0


def test_camera_and_lamp_stay_apart(rig_file: Path) -> None:
    """The way of one axis depends on where the others stand: each move is checked from there."""
    text = rig_file.read_text().replace(
        "keep_out:", "keep_out:\n  - {name: lamp housing, camera_to_lamp_deg: 8.0}"
    )
    rig_file.write_text(text.replace("theta_r:\n    {", "theta_r:\n    {home_deg: -40.0, "))
    with open_rig(rig_file) as rig:
        rig.ready()
        assert rig.theta_i.set(30.0).exception(60.0) is None
        for across in (60.0, 22.5):
            error = rig.theta_r.set(across).exception(60.0)
            assert "keep-out zone 'lamp housing'" in str(error)
            assert rig.theta_r.locate()["readback"] == -40.0
        assert rig.theta_r.set(20.0).exception(60.0) is None


def test_the_lamp_is_dark_and_the_rig_refuses_after_its_end(rig: RigDevices) -> None:
    rig.camera.stage().wait()
    assert rig.lamp.read()["lamp"]["value"] == "light"
    rig.close()
    rig.close()
    assert rig.lamp.read()["lamp"]["value"] == "dark"
    with pytest.raises(DeviceError, match="the rig is closed: open it again"):
        rig.theta_r.set(10.0)
    rig.theta_r.stop()


def test_a_protocol_gives_sample_window_and_frames() -> None:
    demo = CONFIGS / "protocols" / "demo.yaml"
    with open_rig(protocol=demo) as rig:
        told = rig.camera.read_configuration()
        assert told["camera_window_width_mm"]["value"] == 20.0
        assert told["camera_frames"]["value"] == 4
        assert "simulated" in str(told["camera_identity"]["value"])


def test_a_rig_that_cannot_be_driven_is_refused() -> None:
    with pytest.raises(InputError, match="neither a rig file nor a protocol is named"):
        open_rig()
    with pytest.raises(InputError, match=r"emulated\.yaml: its camera is emulated"):
        open_rig(CONFIGS / "rigs" / "emulated.yaml")
