"""A stop reaches the wire while the record hangs for ever, and the command says so and ends."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from tests.support.paths import CONFIGS, ROOT
from tests.support.stages.hangup_child import PROTOCOL

pytestmark = pytest.mark.waits

DEADLINE_S = 60.0
ON_THE_WIRE_S = 0.5  # measured: 3 ms; the bound is for a busy machine


@pytest.mark.parametrize("hangs", ["disk", "record"])
def test_a_stop_waits_for_no_disk_and_no_other_program(
    hangs: str, hung_disk: dict[str, str], tmp_path: Path
) -> None:
    """The main thread can neither be late with the stop nor keep the command from its end."""
    rig = CONFIGS / "rigs" / "bench_12bit.yaml"
    (tmp_path / "protocol.yaml").write_text(PROTOCOL.format(rig=rig))
    reading, writing = os.pipe()
    child = [sys.executable, "-m", "tests.support.stages.hangup_child", str(writing)]
    with os.fdopen(reading, encoding="utf-8") as said, (tmp_path / "text").open("w+") as text:
        scanning = subprocess.Popen(
            [*child, tmp_path, hangs], cwd=ROOT, stdin=subprocess.DEVNULL, stdout=text,
            stderr=text, pass_fds=[writing], start_new_session=True,
            env={**os.environ, **hung_disk},
        )  # fmt: skip
        os.close(writing)
        patience = threading.Timer(DEADLINE_S, scanning.kill)
        patience.start()
        try:
            assert said.readline() == "moving\n"
            struck_s = time.monotonic()
            scanning.send_signal(signal.SIGINT)
            code, stops, moving, lit = json.loads(said.readline())
            assert scanning.wait() == 0
        finally:
            patience.cancel()
            scanning.kill()
            scanning.wait()
            Path(hung_disk["GONIO_HUNG_DISK"]).unlink(missing_ok=True)
        shown = (tmp_path / "text").read_text()
    after_s = [at_s - struck_s for at_s in stops if at_s >= struck_s]
    assert 0 <= after_s[0] < ON_THE_WIRE_S
    assert (code, moving, lit) == (4, False, False)
    assert "stopped by the operator: all motion has ended." in shown
    assert "record.sqlite: the last write has not ended" in shown
