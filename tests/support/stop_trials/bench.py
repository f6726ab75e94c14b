"""Process of the emulated devices of one trial: it outlives the program and logs what happens.

The trial asks for things in lines of JSON, each with one line in answer.
"""

from __future__ import annotations

import json
import os
import socket
import threading
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from instrument.clock import SystemClock
from sim.emulated.motor import Mechanics
from sim.emulated.newport_controller import NewportController
from sim.emulated.oriental_controller import OrientalController
from sim.emulated.wire import Controller, PtyWire
from sim.emulated.zaber_controller import ZaberController
from tests.support.stages.modbus_tcp_gateway import ModbusTcpGateway, TcpWire
from tests.support.stop_trials.spoilt_bytes import STOPS, Spoiling, SpoiltDrive, SpoiltLine
from tests.support.stop_trials.trial import MAX_DEG, MIN_DEG, Trial
from tests.support.stop_trials.true_motor import TrueMotor

STEPS_PER_DEG = 1000.0
_BEYOND_DEG = 5.0  # of the controller's own limits, beyond those of the rig file
_APPROACH_DEG = 1.0
_TICK_S = 0.01
_XOFF = b"\x13"


class Devices:
    """One axis behind its controller, on a port with a name that stays when it is unplugged."""

    def __init__(self, trial: Trial, link: Path) -> None:
        self._link, self._tcp_port = link, 0
        self._wire: PtyWire | TcpWire | None = None
        mechanics = Mechanics(
            min_deg=MIN_DEG - _BEYOND_DEG,
            max_deg=MAX_DEG + _BEYOND_DEG,
            speed_deg_per_s=trial.speed_deg_per_s,
            acceleration_deg_per_s2=trial.acceleration_deg_per_s2,
            homing_s=trial.homing_s,
        )
        self.motor = TrueMotor(
            mechanics, SystemClock(), trial.start_deg, referenced=trial.command == "move"
        )
        self.spoiling = Spoiling(STOPS[trial.controller])
        self._tcp = trial.controller == "az tcp"
        self._line = _line(trial.controller, self.motor, self.spoiling)
        self.late: list[tuple[float, float]] = []
        self.port = self.plug()
        threading.Thread(target=self._measure_lateness, daemon=True).start()

    def plug(self) -> str:
        """Plug the port in; return its name."""
        if self._tcp:
            gateway = self._wire = TcpWire([self._line], self._tcp_port)
            self._tcp_port = gateway.port
            return f"tcp://{gateway.host}:{gateway.port}"
        wire = self._wire = PtyWire([self._line])
        self._link.symlink_to(wire.port)
        return str(self._link)

    def unplug(self) -> float:
        """Pull the port out; return the time."""
        unplugged_s = time.monotonic()
        self._link.unlink(missing_ok=True)
        if self._wire is not None:
            self._wire.close()
        return unplugged_s

    def replug(self) -> float:
        """Plug the port in again; return the time."""
        self.plug()
        return time.monotonic()

    def noise(self) -> None:
        """Send a byte that no controller sends."""
        if isinstance(self._wire, PtyWire):
            self._wire.send_noise(_XOFF)

    def await_motion(self, kind: str, number: int, seconds: float) -> dict[str, Any] | None:
        """Return the motion of this kind and number, None if it does not begin in time.

        Short moves, by which a target is approached from one side, are not counted.
        """
        until_s = time.monotonic() + seconds
        while True:
            found = [
                motion
                for motion in self.motor.motions
                if motion.kind == kind
                and (kind == "home" or abs(motion.to_deg - motion.from_deg) > _APPROACH_DEG)
            ]
            if len(found) >= number:
                return asdict(found[number - 1])
            if time.monotonic() > until_s:
                return None
            time.sleep(0.002)

    def log(self) -> dict[str, Any]:
        """Return motions, messages, delays of this process, and the present state."""
        motor = self.motor
        return {
            "now_s": time.monotonic(),
            "motions": [asdict(motion) for motion in motor.motions],
            "wire": [(at_s, way, data.hex()) for at_s, way, data in self.spoiling.log],
            "late": self.late,
            "position_deg": motor.position_deg,
            "moving": motor.moving,
            "referenced": motor.referenced,
        }

    def _measure_lateness(self) -> None:
        woken_s = time.monotonic()
        while True:
            time.sleep(_TICK_S)
            now_s = time.monotonic()
            self.late.append((now_s, now_s - woken_s - _TICK_S))
            woken_s = now_s

    def obey(self, order: dict[str, Any]) -> Any:
        """Do what the trial asks for."""
        match order.pop("do"):
            case "spoil":
                self.spoiling.spoil(**order)
            case "lose answers":
                self.spoiling.lose_answers(**order)
            case "noise":
                self.noise()
            case "unplug":
                return self.unplug()
            case "replug":
                return self.replug()
            case "await motion":
                return self.await_motion(**order)
            case "log":
                return self.log()
        return None


def _line(controller: str, motor: TrueMotor, spoiling: Spoiling) -> Controller:
    match controller:
        case "zaber":
            return SpoiltLine(ZaberController(motor), spoiling)
        case "smc100":
            return SpoiltLine(NewportController(motor), spoiling)
        case "conex":
            return SpoiltLine(NewportController(motor, model="CONEX-CC"), spoiling)
    drive = OrientalController(motor, steps_per_deg=STEPS_PER_DEG)
    if controller == "az tcp":
        return ModbusTcpGateway([SpoiltDrive(drive, spoiling)])
    return SpoiltLine(drive, spoiling)


class Bench:
    """The devices' process, as the trial sees it; use it with `with`."""

    def __init__(self, trial: Trial, link: Path) -> None:
        ours, theirs = socket.socketpair()
        self._pid = os.fork()
        if self._pid == 0:
            ours.close()
            _serve(trial, link, theirs)
        theirs.close()
        self._socket = ours
        self._answers = ours.makefile()
        self.port = str(json.loads(self._answers.readline()))

    def ask(self, do: str, **details: Any) -> Any:
        """Have something done; return the answer."""
        self._socket.sendall(f"{json.dumps({'do': do, **details})}\n".encode())
        return json.loads(self._answers.readline())

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()
        self._answers.close()
        os.waitpid(self._pid, 0)


def _serve(trial: Trial, link: Path, peer: socket.socket) -> None:
    """Serve the trial until it hangs up; the process ends here."""
    code = 1
    try:
        devices = Devices(trial, link)
        peer.sendall(f"{json.dumps(devices.port)}\n".encode())
        for line in peer.makefile():
            peer.sendall(f"{json.dumps(devices.obey(json.loads(line)))}\n".encode())
        code = 0
    finally:
        os._exit(code)
