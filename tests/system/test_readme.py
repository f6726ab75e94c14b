"""Every command and example in the README works."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

from instrument.config.load import load_protocol
from tests.support.command import gonio_here
from tests.support.paths import CONFIGS, ROOT

README = (ROOT / "README.md").read_text()


def _blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_commands_succeed_in_the_order_given(tmp_path: Path) -> None:
    shutil.copytree(CONFIGS, tmp_path / "configs")
    commands = [line for block in _blocks("sh") for line in block.splitlines()]
    gonio = [line.split()[1:] for line in commands if line.startswith("gonio ")]
    assert len(gonio) >= 4
    for arguments in gonio:
        if arguments[0] == "bench":  # takes minutes; tested in `tests/acquisition/benchmark`
            arguments = ["bench", "--help"]  # noqa: PLW2901 - only its help
        done = gonio_here(*arguments, cwd=tmp_path)
        assert done.returncode == 0, (arguments, done.stderr)


def test_the_make_targets_exist() -> None:
    makefile = (ROOT / "Makefile").read_text()
    targets = re.findall(r"^make (\w+)$", "\n".join(_blocks("sh")), flags=re.MULTILINE)
    assert targets == ["demo", "test"]
    assert all(re.search(rf"^{target}:", makefile, flags=re.MULTILINE) for target in targets)


def test_the_protocol_is_valid(tmp_path: Path) -> None:
    (block,) = _blocks("yaml")
    path = tmp_path / "protocol.yaml"
    path.write_text(block)
    loaded = load_protocol(path, CONFIGS / "rigs" / "bench_12bit.yaml")
    assert loaded.protocol.name == "plaster"


def test_the_python_example_runs() -> None:
    (block,) = _blocks("python")
    done = subprocess.run([sys.executable, "-c", block], check=False, capture_output=True)
    assert done.returncode == 0, done.stderr
