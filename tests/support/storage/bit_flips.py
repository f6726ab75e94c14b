"""Files with one flipped bit, as a failing disk or memory leaves them."""

from __future__ import annotations

import random
from collections.abc import Iterator


def flips(data: bytes, seed: int) -> Iterator[bytes]:
    """Yield the data with one bit flipped, without end; half of the flips in bytes that are not 0.

    Much of a database is empty space, where a flip changes nothing.
    """
    draw = random.Random(seed)
    filled = [at for at, byte in enumerate(data) if byte]
    while True:
        at = draw.choice(filled) if draw.random() < 0.5 else draw.randrange(len(data))
        spoilt = bytearray(data)
        spoilt[at] ^= 1 << draw.randrange(8)
        yield bytes(spoilt)
