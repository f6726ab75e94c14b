"""Stand-ins for devices: pass all calls on, and record or replace some of them."""

from __future__ import annotations


class PassThrough:
    """Passes every attribute on to a device; subclasses override some."""

    def __init__(self, device: object) -> None:
        self._device = device

    def __getattr__(self, name: str) -> object:
        return getattr(self._device, name)


class Spy(PassThrough):
    """Records the names of the attributes used, each after the device's name."""

    def __init__(self, device: object, calls: list[str], name: str) -> None:
        super().__init__(device)
        self._calls, self._name = calls, name

    def __getattr__(self, name: str) -> object:
        self._calls.append(f"{self._name}.{name}")
        return super().__getattr__(name)
