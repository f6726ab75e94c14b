"""Questions for one axis of a rig file: driver, connection, limits, speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.drafts.question import Answers, Question, Script, choice, number, number_of
from acquisition.drafts.yaml_words import in_comment
from drivers.discovery import FoundPort
from instrument.config.axes import AXES
from instrument.errors import InputError
from instrument.text.quoting import shown

_DRIVERS = (
    ("hand", "the operator sets it, asked at the terminal"),
    ("newport", "Newport SMC100 or CONEX-CC"),
    ("zaber", "Zaber, ASCII protocol"),
    ("oriental", "Oriental Motor AZ, Modbus RTU or TCP"),
)
_SIMULATED = (
    ("simulated", "a motor"),
    ("hand", "the simulated operator sets it"),
)
_MODELS = (("SMC100", "57600 baud"), ("CONEX-CC", "921600 baud"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Usual:
    """Usual limits of an axis in degrees, for a motor and by hand, and its text."""

    text: str
    motor_deg: tuple[float, float]
    hand_deg: tuple[float, float]


USUAL = {
    "theta_i": Usual(
        text="lamp's angle from the sample's normal", motor_deg=(-1.0, 85.0), hand_deg=(0.0, 85.0)
    ),
    "dphi": Usual(
        text="azimuth between lamp and camera", motor_deg=(-1.0, 181.0), hand_deg=(0.0, 180.0)
    ),
    "theta_r": Usual(
        text="camera's angle from the sample's normal",
        motor_deg=(-88.0, 88.0),
        hand_deg=(-85.0, 85.0),
    ),
}
_CONNECTION = ("model", "address", "device", "axis", "microsteps_per_deg", "unit", "steps_per_deg")


def axis_questions(
    name: str, ports: Sequence[FoundPort], answers: Answers, *, simulated: bool
) -> Script:
    """Yield the questions of one axis; `answers` holds those given to the earlier ones."""
    usual, key = USUAL[name], f"{name}.driver"
    offers = _SIMULATED if simulated else _DRIVERS
    text = f"motor of {name}, the {usual.text}"
    yield choice(key, text, offers, offers[0][0] if simulated else _known_driver(name, ports))
    driver = str(answers[key])
    if driver not in ("hand", "simulated"):
        yield _port(name, driver, ports, answers)
        yield from _address(name, driver, ports, answers)
    low, high = usual.hand_deg if driver == "hand" else usual.motor_deg
    yield number(f"{name}.min_deg", f"lowest angle of {name}, in degrees", low, -360, 360)
    lowest = number_of(answers, f"{name}.min_deg")
    high = high if high > lowest else lowest + 1
    yield number(f"{name}.max_deg", f"highest angle of {name}, in degrees", high, -361, 361)
    if driver != "hand":
        speed = 20.0 if simulated else 5.0
        text = f"speed of {name}, in degrees per second"
        yield number(f"{name}.speed_deg_per_s", text, speed, 0.0, 1000.0, open_low=True)


def connection(name: str, answers: Answers) -> list[str]:
    """Return the keys of an axis that say where on its port a motor is, in their order."""
    return [key for key in _CONNECTION if f"{name}.{key}" in answers]


def _known_driver(name: str, ports: Sequence[FoundPort]) -> str:
    """Return the driver whose controller answered, for the axis that most rigs have a motor on."""
    answered = [port.driver for port in ports if port.driver]
    return answered[0] if answered and name == "theta_r" else "hand"


def _port(name: str, driver: str, ports: Sequence[FoundPort], answers: Answers) -> Question:
    """Question of the port; the default is one whose controller answered, or that is free."""
    others = {
        answers[f"{axis}.port"]: answers[f"{axis}.driver"]
        for axis in AXES
        if f"{axis}.port" in answers and axis != name
    }
    free = [port for port in ports if others.get(port.path, driver) == driver]
    free.sort(key=lambda port: port.driver != driver)
    default = free[0].path if free else f"/dev/ttyUSB{AXES.index(name)}"
    offers = [(port.path, in_comment(port.text)) for port in ports]
    guess = "" if free else "no serial port was found for it"
    text = "its port" if driver != "oriental" else "its port, or tcp://host:port of a gateway"
    return choice(f"{name}.port", text, offers, default, other=_path, guess=guess)


def _path(answer: str) -> str:
    if not answer.startswith(("/", "tcp://", "socket://", "rfc2217://")):
        raise InputError(
            f"{shown(answer)}; allowed: a path such as /dev/serial/by-id/..., or tcp://, "
            "socket:// or rfc2217:// with host:port"
        )
    return answer


def _address(name: str, driver: str, ports: Sequence[FoundPort], answers: Answers) -> Script:
    """Yield the questions that tell a motor from others on its port."""
    port = answers[f"{name}.port"]
    shared = [axis for axis in AXES if axis != name and answers.get(f"{axis}.port") == port]
    next_one = 1 + len(shared)
    if driver == "newport":
        conex = any(p.path == port and p.answer.endswith("CONEX-CC") for p in ports)
        model = answers.get(f"{shared[0]}.model") if shared else None
        usual = model or ("CONEX-CC" if conex else "SMC100")
        yield choice(f"{name}.model", "its controller", _MODELS, str(usual))
        yield number(f"{name}.address", "its address", next_one, 1, 31, whole=True)
    elif driver == "zaber":
        yield number(f"{name}.device", "its device number", next_one, 1, 99, whole=True)
        yield number(f"{name}.axis", "axis number of the device", 1, 1, 9, whole=True)
        yield number(
            f"{name}.microsteps_per_deg", "microsteps per degree, a constant of the stage",
            4266.666667, open_low=True, guess="a wrong number turns the stage too far",
        )  # fmt: skip
    else:
        yield number(
            f"{name}.unit", "its unit number (server address)", next_one, 1, 247, whole=True
        )
        yield number(
            f"{name}.steps_per_deg", "steps per degree, by its gear and its electronic gear",
            100.0, open_low=True, guess="a wrong number turns the stage too far",
        )  # fmt: skip
