"""Modbus line and emulated drive against independent Modbus masters and slaves.

An error common to driver and emulated drive would show here. Each test is skipped if its peer is
not installed: minimalmodbus, modbus_tk and pyModbusTCP from PyPI, mbpoll and libmodbus-dev from
Debian.
"""

from __future__ import annotations

import os
import re
import select
import shutil
import subprocess
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from drivers.lines.modbus_bus import ModbusBus, ModbusUnit
from drivers.lines.modbus_client import BusSettings
from drivers.stages.oriental_framing import (
    DIRECT_DATA,
    DIRECT_DATA_COUNT,
    FEEDBACK_POSITION,
    INPUT_WORD,
    STOP,
    direct_data_of,
    move_block,
    value_of,
)
from instrument.clock import SystemClock
from instrument.errors import DeviceError
from sim.emulated.motor import Motor
from sim.emulated.oriental_controller import OrientalController
from sim.emulated.wire import PtyWire
from tests.support.stages.emulated_az_drive import FAST, LIMITS
from tests.support.stages.kinds import AzStage
from tests.support.stages.modbus_tcp_gateway import ModbusTcpGateway, TcpWire

pytestmark = pytest.mark.waits

TARGET_STEPS = -1234


@pytest.fixture
def drive() -> OrientalController:
    return OrientalController(Motor(FAST, SystemClock()), steps_per_deg=100.0)


def _arrives(drive: OrientalController) -> None:
    deadline_s = time.monotonic() + 5
    while drive.motor.moving:
        assert time.monotonic() < deadline_s
        time.sleep(0.002)


def test_minimalmodbus_homes_and_moves_our_drive(drive: OrientalController) -> None:
    minimalmodbus = pytest.importorskip("minimalmodbus", reason="minimalmodbus is not installed")
    with PtyWire([drive]) as wire:
        master = minimalmodbus.Instrument(wire.port, 1)
        try:
            master.serial.baudrate, master.serial.timeout = 115200, 0.5
            master.write_register(0x7D, 1 << 4, functioncode=6)  # ZHOME
            _arrives(drive)
            assert master.read_registers(0x7E, 4) == [0, 1 << 14 | 1 << 5 | 1 << 4, 0, 0]
            master.write_registers(0x58, list(move_block(TARGET_STEPS, 2000, 1500)))
            _arrives(drive)
            assert master.read_long(0xCC, signed=True) == TARGET_STEPS
            assert master.read_long(0xC6, signed=True) == TARGET_STEPS
            with pytest.raises(minimalmodbus.IllegalRequestError):
                master.read_register(0x1000)
        finally:
            master.serial.close()
    assert drive.triggers == 1


@pytest.mark.parametrize("kind", ["rtu", "tcp"])
def test_mbpoll_homes_and_moves_our_drive(drive: OrientalController, kind: str) -> None:
    if not shutil.which("mbpoll"):
        pytest.skip("mbpoll (Debian package mbpoll) is not installed")
    with PtyWire([drive]) if kind == "rtu" else TcpWire([ModbusTcpGateway([drive])]) as wire:
        _mbpoll(wire, 0x7D, "16", count=0)
        _arrives(drive)
        _mbpoll(wire, 0x58, *map(str, move_block(12345, 200_000, 10_000_000)), count=0)
        _arrives(drive)
        assert _mbpoll(wire, 0xCC, count=2) == [0, 12345]
        assert _mbpoll(wire, 0x7E, count=4) == [0, 1 << 14 | 1 << 5 | 1 << 4, 0, 0]
    assert (drive.homings, drive.triggers) == (1, 1)


def _mbpoll(wire: PtyWire | TcpWire, register: int, *values: str, count: int) -> list[int]:
    if isinstance(wire, PtyWire):
        line = ["-m", "rtu", "-b", "115200", "-P", "none", wire.port]
    else:
        line = ["-p", str(wire.port), wire.host]
    asked = ["-c", str(count)] if count else []
    command = ["mbpoll", "-0", "-1", "-t", "4", "-a", "1", "-r", str(register), *asked, *line]
    done = subprocess.run(
        [*command, *values], check=False, capture_output=True, text=True, timeout=10
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return [int(value) for value in re.findall(r"^\[\d+\]:\s+(\d+)", done.stdout, re.MULTILINE)]


def _exercise_line(port: str) -> None:
    """Read, write in both ways, read back, and recognise a refusal."""
    settings = BusSettings(port, parity="N", reply_s=0.4)
    with ModbusBus("peer", settings, SystemClock()) as bus:
        unit = ModbusUnit(bus, "peer", 1, DIRECT_DATA, (6, 8, 10))
        assert value_of(unit.read(FEEDBACK_POSITION, 2)) == 8500
        unit.write(DIRECT_DATA, move_block(TARGET_STEPS, 2000, 1500), unit.deadline_s())
        back = direct_data_of(unit.read(DIRECT_DATA, DIRECT_DATA_COUNT))
        assert (back.position, back.speed_hz, back.trigger) == (TARGET_STEPS, 2000, 1)
        unit.write_at_once(INPUT_WORD, STOP)
        assert unit.read(INPUT_WORD, 1) == [STOP]
        with pytest.raises(DeviceError, match=r"register 1000 hex .* exception 02"):
            unit.read(0x1000, 1)
        unit.write(0xFF, [1], unit.deadline_s())


def test_our_line_with_a_slave_of_libmodbus(tmp_path: Path) -> None:
    slave = _compiled(tmp_path)
    with _joined_ports() as (theirs, ours):
        running = subprocess.Popen([slave, theirs, "1"])
        try:
            _exercise_line(ours)
            assert running.wait(timeout=5) == 0
        finally:
            running.kill()
            running.wait()


def _compiled(folder: Path) -> Path:
    source, program = Path(__file__).with_name("libmodbus_slave.c"), folder / "slave"
    compiler = shutil.which("cc")
    if not compiler:
        pytest.skip("a C compiler (Debian package gcc) is not installed")
    flags = ["-Wall", "-Wextra", "-Werror", "-I/usr/include/modbus"]
    found = subprocess.run(
        [compiler, "-E", *flags, "-include", "modbus.h", "-x", "c", os.devnull],
        check=False,
        capture_output=True,
    )
    if found.returncode:
        pytest.skip("libmodbus (Debian package libmodbus-dev) is not installed")
    subprocess.run([compiler, *flags, source, "-o", program, "-lmodbus"], check=True, timeout=60)
    return program


@contextmanager
def _joined_ports() -> Iterator[tuple[str, str]]:
    """Both ends of a serial line: two pseudo-terminals with their masters joined."""
    ends, ports = [], []
    for _ in range(2):
        master, slave = os.openpty()
        tty.setraw(slave)
        ends.append((master, slave))
        ports.append(os.ttyname(slave))
    (left, _), (right, _) = ends
    done, wake = os.pipe()

    def carry() -> None:
        while done not in (readable := select.select([left, right, done], [], [])[0]):
            for end in readable:
                os.write(right if end == left else left, os.read(end, 4096))

    thread = threading.Thread(target=carry, daemon=True)
    thread.start()
    try:
        yield ports[0], ports[1]
    finally:
        os.close(wake)
        thread.join(timeout=5)
        for descriptor in (*ends[0], *ends[1], done):
            os.close(descriptor)


@pytest.mark.filterwarnings("ignore:isSet:DeprecationWarning")  # modbus_tk's own
def test_our_line_with_a_slave_of_modbus_tk() -> None:
    pytest.importorskip("modbus_tk", reason="modbus_tk is not installed")
    import serial
    from modbus_tk import defines, modbus_rtu

    with _joined_ports() as (theirs, ours):
        server = modbus_rtu.RtuServer(serial.Serial(theirs, 115200, timeout=0.02))
        slave = server.add_slave(1)
        slave.add_block("all", defines.HOLDING_REGISTERS, 0, 256)
        slave.set_values("all", 0xCD, 8500)
        server.start()
        try:
            _exercise_line(ours)
        finally:
            server.stop()


def test_our_line_with_a_slave_of_pymodbustcp() -> None:
    pytest.importorskip("pyModbusTCP", reason="pyModbusTCP is not installed")
    from pyModbusTCP.server import DataBank, ModbusServer

    bank = DataBank(h_regs_size=256)
    bank.set_holding_registers(0xCD, [8500])
    with TcpWire([]) as wire:
        port = wire.port  # free once the wire is closed
    server = ModbusServer("127.0.0.1", port, no_block=True, data_bank=bank)
    server.start()
    try:
        _exercise_line(f"tcp://127.0.0.1:{port}")
    finally:
        server.stop()


def test_a_foreign_slave_is_no_az_drive(tmp_path: Path) -> None:
    with _joined_ports() as (theirs, ours):
        running = subprocess.Popen([_compiled(tmp_path), theirs, "1"])
        settings = BusSettings(ours, parity="N")
        try:
            with ModbusBus("peer", settings, SystemClock()) as bus:
                unit = ModbusUnit(bus, "peer", 1, DIRECT_DATA, (6, 8))
                unit.write(DIRECT_DATA + 1, [999], unit.deadline_s())
            with pytest.raises(DeviceError, match="is no Oriental Motor AZ drive: data number 999"):
                AzStage(settings, LIMITS)
        finally:
            running.kill()
            running.wait()
