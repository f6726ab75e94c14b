"""Devices as found on a bench, and answers that a person could type to a prompt."""

from __future__ import annotations

import re
from pathlib import Path
from random import Random

from acquisition.drafts.rig_questions import Bench
from drivers.discovery import FoundPort
from drivers.v4l2 import ioctl
from drivers.v4l2.listing import FoundCamera

CAMERA = "/dev/v4l/by-id/usb-Maker_Camera_7-video-index0"
PORTS = tuple(f"/dev/serial/by-id/usb-Adapter_{n}-if00-port0" for n in (1, 2))


def found_camera(**changed: object) -> FoundCamera:
    """A camera with two usable formats, a control of its exposure and one of its gain."""
    exposure = ioctl.Control(ioctl.EXPOSURE_ABSOLUTE, "Exposure", "integer", 1, 5000, 1, 156, 156)
    gain = ioctl.Control(ioctl.GAIN, "Gain", "integer", 0, 480, 10, 100, 100)
    own = {
        "device": CAMERA,
        "card": "Camera\n7 \x1b[2J",
        "driver": "uvcvideo",
        "bus": "usb-1",
        "purpose": "",
        "formats": {"MJPG": ("640 x 480",), "YUYV": ("640 x 480", "1280 x 720"), "Y16": ()},
        "controls": (exposure, gain),
    }
    return FoundCamera(**{**own, **changed})  # type: ignore[arg-type]  # of the test's choice


def full_bench(folder: Path) -> Bench:
    """A camera, two serial ports of which one has a Newport controller, and no calibration."""
    ports = (
        FoundPort(path=PORTS[0], text="ttyUSB0: adapter"),
        FoundPort(path=PORTS[1], text="ttyUSB1: x", answer="'1VE' when asked as Newport SMC100"),
    )
    return Bench(folder=folder, name="bench", cameras=(found_camera(),), ports=ports)


class Typist:
    """Person who answers prompts at random, mostly as these allow, and gives up after a refusal."""

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)
        self.refused: list[tuple[str, str]] = []  # answer, and the reason that was given
        self.answers: dict[str, str] = {}
        self._prompt = ""

    def ask(self, prompt: str) -> str:
        """Answer a prompt; Enter where it is repeated."""
        repeated, self._prompt = prompt == self._prompt, prompt
        answer = "" if repeated or self.random.random() < 0.6 else self._answer(prompt)
        self.answers[prompt.partition(":")[0]] = answer
        return answer

    def say(self, text: str) -> None:
        """Take note of a refusal."""
        key, _, reason = text.strip().partition(": ")
        self.refused.append((self.answers[key], reason))

    def _answer(self, prompt: str) -> str:
        if self.random.random() < 0.1:
            return self.random.choice(
                ["x", "-1", "5 mm", "1e3", "99999", "/dev/x", "{a: b}", "0.0"]
            )
        numbered = re.findall(r"^ +([0-9]+)  ", prompt, flags=re.MULTILINE)
        if numbered:
            return self.random.choice(numbered)
        return self._typed(prompt)

    def _typed(self, prompt: str) -> str:
        spans = re.findall(r"from (-?[0-9.]+) to ([0-9.]+)", prompt)
        whole = "whole" in prompt
        if "numbers from" in prompt:
            low, high = map(float, spans[-1])
            angles = [self.random.uniform(low, high) for _ in range(self.random.randint(1, 3))]
            return ", ".join(f"{angle:.2f}" for angle in angles)
        if "text of" in prompt:
            return self.random.choice(["Wall: a #1", "true", "12", "'", '"}', "ä {x} \\", "- a"])
        if spans and "number" in prompt:
            low, high = map(float, spans[-1])
            high = min(high, low + 40) if whole else high  # a scan of few points
            number = self.random.uniform(low, high)
            return f"{number:.0f}" if whole else f"{number:.3f}"
        return f"{10 ** self.random.uniform(-2, 4):.4f}"
