"""bluesky-queueserver measures two protocols on two simulated rigs, as the document says."""

from __future__ import annotations

import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from acquisition.commands.scan import scan_into
from acquisition.facility.table_columns import columns_of
from acquisition.results.finish import finish
from instrument.config.load import load_protocol
from tests.support.paths import ROOT
from tests.support.scans import small_demo, small_rig
from tests.support.stages.waiting import wait_until

pytest.importorskip(
    "bluesky_queueserver", reason="bluesky-queueserver is not installed: gonio[queueserver]"
)
zmq = pytest.importorskip("zmq")
pytestmark = pytest.mark.long
DEADLINE_S = 120.0


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def process(*command: object, cwd: Path) -> Iterator[None]:
    """A process that ends with the `with` block; its output is a file there."""
    words = [str(word) for word in command]
    with (cwd / f"{Path(words[0]).name}.log").open("w") as log:
        started = subprocess.Popen(words, cwd=cwd, stdout=log, stderr=log)
        try:
            yield
        finally:
            started.terminate()
            started.wait(DEADLINE_S)


class Manager:
    """Manager of the queue, by its control socket."""

    def __init__(self, address: str) -> None:
        self._address = address

    def ask(self, method: str, **parameters: object) -> dict[str, Any]:
        told = self._answer(method, parameters, DEADLINE_S)
        assert told.get("success"), told or f"{method}: no answer within {DEADLINE_S} s"
        return told

    def wait_for(self, key: str, *wanted: object) -> None:
        """Return once the manager's state has one of these values."""
        wait_until(lambda: self._answer("status", {}, 1.0).get(key) in wanted, DEADLINE_S)

    def wait_for_plan(self, name: str) -> None:
        """Return once the plan may be added: the manager reads the list after it is idle."""
        wait_until(
            lambda: name in self.ask("plans_allowed", user_group="primary")["plans_allowed"],
            DEADLINE_S,
        )

    def _answer(
        self, method: str, parameters: dict[str, object], within_s: float
    ) -> dict[str, Any]:
        """Answer to one request; empty if there is none in time."""
        with zmq.Context() as context, context.socket(zmq.REQ) as request:
            request.linger = 0
            request.connect(self._address)
            request.send_json({"method": method, "params": parameters})
            return dict(request.recv_json()) if request.poll(1e3 * within_s) else {}


def block(name: str) -> str:
    """A block of the document, by the name in its first line."""
    page = (ROOT / "docs" / "facility" / "bluesky.md").read_text()
    (found,) = re.findall(rf"```\w+\n(# {re.escape(name)}\n.*?)```", page, flags=re.DOTALL)
    return str(found)


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[Manager]:
    server = shutil.which("redis-server")
    if server is None:
        pytest.skip("no redis-server for the queue (Debian: redis-server)")
    startup = tmp_path / "startup"
    startup.mkdir()
    for name in ("startup.py", "user_group_permissions.yaml"):
        (startup / name).write_text(block(name))
    redis, control, info = (free_port() for _ in range(3))
    command = [Path(sys.executable).with_name("start-re-manager"), "--startup-dir", startup]
    addresses = ["--redis-addr", f"127.0.0.1:{redis}"]
    addresses += ["--zmq-control-addr", f"tcp://127.0.0.1:{control}"]
    addresses += ["--zmq-info-addr", f"tcp://127.0.0.1:{info}"]
    with ExitStack() as stack:
        options = ["--port", redis, "--bind", "127.0.0.1", "--save", "", "--appendonly", "no"]
        stack.enter_context(process(server, *options, cwd=tmp_path))
        stack.enter_context(process(*command, *addresses, "--keep-re", cwd=tmp_path))
        own = Manager(f"tcp://127.0.0.1:{control}")
        own.wait_for("manager_state", "idle")
        yield own
        own.ask("manager_stop", option="safe_off")


def without_dates(run: Path) -> dict[str, Any]:
    columns = columns_of((run / "measurements.csv").read_text())
    columns.pop("time_utc")
    return columns


def test_two_protocols_are_measured_on_two_rigs(manager: Manager, tmp_path: Path) -> None:
    jobs = []
    for name, seed in (("a", 11), ("b", 12)):
        folder = tmp_path / name
        folder.mkdir()
        rig = small_rig(folder, shrink=10)
        rig.write_text(rig.read_text().replace("seed: 2026", f"seed: {seed}"))
        jobs.append((small_demo(folder, "lambert"), rig, folder / "run"))
    manager.ask("environment_open")
    manager.wait_for("worker_environment_state", "idle")
    manager.wait_for_plan("measure")
    for job in jobs:
        item = {"item_type": "plan", "name": "measure", "args": [str(path) for path in job]}
        manager.ask("queue_item_add", item=item, user="test", user_group="primary")
    manager.ask("queue_start")
    manager.wait_for("items_in_history", 2)
    manager.wait_for("manager_state", "idle")
    history = manager.ask("history_get")["items"]
    assert [item["result"]["exit_status"] for item in history] == ["completed"] * 2
    for number, (protocol, rig, run) in enumerate(jobs):
        loaded = load_protocol(protocol, rig)
        by_command = scan_into(loaded, tmp_path / f"command{number}", finish)
        assert without_dates(run) == without_dates(by_command)
    manager.ask("environment_close")
    manager.wait_for("worker_environment_exists", False)
