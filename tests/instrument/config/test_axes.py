"""Axes of a rig file: the conversion to the device's own degrees, and what a port may be."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from instrument.config.axes import Axis, HandAxis, Port
from instrument.config.load import load_rig
from instrument.errors import InputError
from tests.support.paths import CONFIGS

ANGLE = st.floats(-360, 360)


@given(ANGLE, st.sampled_from([1, -1]), ANGLE)
def test_an_angle_converts_to_the_device_and_back(zero: float, sign: int, angle: float) -> None:
    limits = {"min_deg": -20.0, "max_deg": 70.0, "u_deg": 0.1, "driver": "hand"}
    axis = TypeAdapter(Axis).validate_python({**limits, "zero_deg": zero, "sign": sign})
    assert axis.from_device_deg(axis.to_device_deg(angle)) == pytest.approx(angle, abs=1e-9)
    low, high = axis.device_limits_deg()
    assert low < high
    assert {low, high} == {axis.to_device_deg(-20.0), axis.to_device_deg(70.0)}


def test_the_tolerance_is_three_u_but_never_less_than_a_hundredth() -> None:
    axis = HandAxis(driver="hand", min_deg=0.0, max_deg=1.0, u_deg=0.1)
    assert axis.tolerance_deg == pytest.approx(0.3)
    assert axis.model_copy(update={"u_deg": 0.0}).tolerance_deg == 0.01


@pytest.mark.parametrize("port", ["spy:///dev/null?file=mine.txt", "loop://", "alt://x?class=y"])
def test_a_port_is_a_device_or_an_address_and_writes_no_file(port: str, tmp_path: Path) -> None:
    text = (CONFIGS / "rigs" / "emulated.yaml").read_text().replace("port: emulated", "port: P", 1)
    (tmp_path / "rig.yaml").write_text(text.replace("port: P", f"port: '{port}'"))
    with pytest.raises(InputError, match=r"axes\.theta_i\.port: .*allowed: a device's path, sock"):
        load_rig(tmp_path / "rig.yaml")
    for good in ("/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0", "socket://gate:4001"):
        assert TypeAdapter(Port).validate_python(good) == good
