"""A stop is on the wire within 100 ms after Ctrl-C, SIGTERM or a failure of the scan itself."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.ready.ready_process import ReadyProcess
from tests.support.stages.emulated_stages import EMULATED_STAGES
from tests.support.stages.kinds import KINDS

pytestmark = pytest.mark.real_time

# On a half-duplex line a reply may be pending: one reply time-out more.
BOUND_S = {name: 0.1 if kind.full_duplex else 0.3 for name, kind in KINDS.items()}
CAUSES = {"SIGINT": "KeyboardInterrupt", "SIGTERM": "KeyboardInterrupt", "exception": "DeviceError"}


@pytest.fixture(scope="module")
def child() -> Iterator[ReadyProcess]:
    with ReadyProcess("tests.support.stages.stop_child:main", ()) as ready:
        yield ready


@pytest.mark.parametrize("emulated", list(EMULATED_STAGES))
def test_a_stop_is_on_the_wire_in_time(emulated: str, child: ReadyProcess) -> None:
    done = child.run(emulated, *CAUSES)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[::2] == list(CAUSES.values())
    for cause, figures in zip(CAUSES, lines[1::2], strict=True):
        seconds, moving = figures.split()
        assert 0 <= float(seconds) < BOUND_S[emulated], cause
        assert moving == "False", cause
