"""Mutation of valid inputs with a seed, and the loop that feeds the mutations to a reader.

`Mutator(examples, seed)(n)` returns the same bytes every time, so a failure is reproduced from the
seed and the number in its message.
"""

from __future__ import annotations

import gc
import random
import re
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

NUMBERS = (
    b"nan", b"-nan", b"inf", b"-inf", b"1e999", b"-1e308", b"1e-320", b"0", b"-0", b"1_000",
    b"0x1F", b"9" * 40, b"9" * 5000, b"1." + b"0" * 400, b"\xd9\xa3", b"1,5", b"--1", b"+",
    b"4294967296", b"-2147483649", b"9223372036854775808",
)  # fmt: skip
WORDS = (
    b"\0", b"\0\0\0", b"\xef\xbb\xbf", b"\xff\xfe", b"\xed\xa0\x80", b"\xc3(", b"\xe2\x80\xa8",
    b"\x1b[2J", b"\x7f", b"\x85", b"\r", b"\r\n", b"\n\n", b"\n\r", b"\t", b"\x0c", b" ", b"",
)  # fmt: skip
_NUMBER = re.compile(rb"[-+]?[0-9]+(\.[0-9]*)?")
_ENCODINGS = ("utf-16", "utf-16-be", "utf-32", "latin-1", "cp037")
MOST_CHANGES = 3


class Mutator:
    """Generator of input number n: one of the examples with a few changes of different kinds.

    `words` are further pieces of text that may upset the format in question.
    """

    def __init__(self, examples: Sequence[bytes], seed: int, words: Sequence[bytes] = ()) -> None:
        self.examples, self.seed = tuple(examples), seed
        self.words = (*WORDS, *NUMBERS, *words)

    def __call__(self, number: int) -> bytes:
        """Return input number n."""
        rng = random.Random(self.seed * 1_000_003 + number)
        return self.spoil(rng, rng.choice(self.examples))

    def spoil(self, rng: random.Random, data: bytes) -> bytes:
        """Return one example with a few changes."""
        for _ in range(rng.randint(1, MOST_CHANGES)):
            data = rng.choice(_CHANGES)(self, rng, data)
        return data

    def __str__(self) -> str:
        return f"Mutator(..., seed={self.seed})"


def _span(rng: random.Random, data: bytes) -> tuple[int, int]:
    """Return start and end of a random piece of the data, usually a short one."""
    start = rng.randint(0, len(data))
    length = min(int(rng.expovariate(0.1)), len(data) - start)
    return start, start + length


def _flip(_: Mutator, rng: random.Random, data: bytes) -> bytes:
    if not data:
        return data
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]


def _byte(_: Mutator, rng: random.Random, data: bytes) -> bytes:
    at = rng.randint(0, len(data))
    return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]


def _cut(_: Mutator, rng: random.Random, data: bytes) -> bytes:
    return data[: rng.randint(0, len(data))]


def _without(_: Mutator, rng: random.Random, data: bytes) -> bytes:
    start, end = _span(rng, data)
    return data[:start] + data[end:]


def _doubled(_: Mutator, rng: random.Random, data: bytes) -> bytes:
    start, end = _span(rng, data)
    times = rng.choice((1, 1, 2, 30))
    return data[:end] + data[start:end] * times + data[end:]


def _swapped(_: Mutator, rng: random.Random, data: bytes) -> bytes:
    (a, b), (c, d) = sorted((_span(rng, data), _span(rng, data)))
    return data if c < b else data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]


def _spliced(self: Mutator, rng: random.Random, data: bytes) -> bytes:
    other = rng.choice(self.examples)
    return data[: rng.randint(0, len(data))] + other[rng.randint(0, len(other)) :]


def _word(self: Mutator, rng: random.Random, data: bytes) -> bytes:
    start, end = _span(rng, data)
    return data[:start] + rng.choice(self.words) + data[rng.choice((start, end)) :]


def _number(_: Mutator, rng: random.Random, data: bytes) -> bytes:
    found = list(_NUMBER.finditer(data))
    if not found:
        return data
    one = rng.choice(found)
    return data[: one.start()] + rng.choice(NUMBERS) + data[one.end() :]


def _line(_: Mutator, rng: random.Random, data: bytes) -> bytes:
    """Return the lines in another order, one repeated, or with other line ends."""
    lines = data.splitlines(keepends=True)
    if not lines:
        return data
    at = rng.randrange(len(lines))
    kind = rng.randrange(4)
    if kind == 0:
        lines[at] *= rng.choice((2, 50))
    elif kind == 1:
        lines.insert(rng.randrange(len(lines)), lines.pop(at))
    elif kind == 2:
        lines[at] = lines[at].rstrip(b"\r\n") + rng.choice((b"\r", b"\r\n", b"\0\n", b""))
    else:
        lines[at] = b" " * rng.randrange(9) + lines[at]
    return b"".join(lines)


def _encoded(_: Mutator, rng: random.Random, data: bytes) -> bytes:
    if rng.random() < 0.8:  # otherwise hardly any input would be readable
        return _flip(_, rng, data)
    return data.decode("utf-8", "replace").encode(rng.choice(_ENCODINGS), "replace")


_CHANGES: tuple[Callable[[Mutator, random.Random, bytes], bytes], ...] = (
    _flip, _byte, _cut, _without, _doubled, _swapped, _spliced, _word, _word, _number, _number,
    _line, _encoded,
)  # fmt: skip

LEAKED_BLOCKS = 0.2  # per input, once all caches are filled; a leaked object is one block or more
LEAKED_BYTES = 32 * 1024**2  # in the second half of all inputs: for large blocks
SLOWEST_S = 5.0  # of CPU time; an input takes milliseconds


def feed(inputs: Callable[[int], bytes], count: int, read: Callable[[bytes], object]) -> None:
    """Call `read` with each of `count` inputs: it must not fail, take long, or leak memory.

    Its exceptions are raised again with the number and the bytes of the input.
    """
    half = _Memory()
    for number in range(count):
        if number == count // 2:
            half = _Memory()
        data = inputs(number)
        began_s = time.process_time()
        try:
            read(data)
        except BaseException as error:
            error.add_note(f"input {number} of {inputs}: {data[:4000]!r}")
            raise
        took_s = time.process_time() - began_s
        assert took_s < SLOWEST_S, f"{took_s:.1f} s for input {number} of {inputs}: {data[:4000]!r}"
    _Memory().compare(half, count - count // 2)


class _Memory:
    """Memory of the process: blocks of the interpreter, and bytes in total."""

    def __init__(self) -> None:
        gc.collect()
        self.blocks = sys.getallocatedblocks()
        pages = Path("/proc/self/statm")
        self.bytes = 4096 * int(pages.read_text().split()[1]) if pages.exists() else 0

    def compare(self, before: _Memory, inputs: int) -> None:
        """Fail if more memory has been kept since `before` than caches explain."""
        kept = self.blocks - before.blocks
        assert kept < 2000 + LEAKED_BLOCKS * inputs, f"{kept} blocks kept by {inputs} inputs"
        grown = self.bytes - before.bytes
        assert grown < LEAKED_BYTES, f"{grown / 1024**2:.1f} MB kept by {inputs} inputs"
