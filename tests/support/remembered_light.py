"""Pictures of the simulated scene that this process has rendered already.

Most tests scan the same sample on the same rig, at the same angles and with the same seed: what
reaches the sensor is the same, and only the noise is drawn anew. Rendering it took a third of their
time.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import fields
from hashlib import blake2b

from sim.scene.render import FloatImage
from sim.scene.scene import Scene

MOST_BYTES = 16_000_000
# Frame, lamp's age and caches: no picture depends on them, as `test_remembered_light` proves.
_NOT_SEEN = {"step", "lit", "clock", "motions", "rings", "_texture", "_lamp_start_s"}
_SEEN = [field.name for field in fields(Scene) if field.name not in _NOT_SEEN]


def scene_key(scene: Scene) -> bytes:
    """Return a digest of all that a picture of the scene depends on."""
    seen = repr((scene.mounted, [getattr(scene, name) for name in _SEEN]))
    return blake2b(seen.encode(), digest_size=16).digest()


class RememberedLight:
    """Renderer, electrons per second of each pixel, that renders each scene once."""

    def __init__(self, render: Callable[[Scene], FloatImage], most_bytes: int = MOST_BYTES) -> None:
        self._render, self._most_bytes = render, most_bytes
        self._images: OrderedDict[bytes, FloatImage] = OrderedDict()
        self._bytes = 0

    def __call__(self, scene: Scene) -> FloatImage:
        """Return the picture, (height, width), read-only."""
        key = scene_key(scene)
        if key in self._images:
            self._images.move_to_end(key)
            return self._images[key]
        image = self._images[key] = self._render(scene)
        image.setflags(write=False)
        self._bytes += image.nbytes
        while self._bytes > self._most_bytes:
            _, oldest = self._images.popitem(last=False)
            self._bytes -= oldest.nbytes
        return image
