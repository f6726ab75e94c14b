"""Every command and example in the README and in the document on rigs works."""

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


RIGS = (ROOT / "docs" / "rigs.md").read_text()


def _blocks(language: str, text: str = README) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def _configs(folder: Path) -> None:
    """Copy the rigs and protocols, with every third view angle: a whole scan proves no more."""
    shutil.copytree(CONFIGS, folder / "configs")
    for path in (folder / "configs" / "protocols").glob("*.yaml"):
        text = path.read_text()
        path.write_text(re.sub(r"num: (\d+)", lambda n: f"num: {(int(n[1]) - 1) // 3 + 1}", text))


def test_the_commands_succeed_in_the_order_given(tmp_path: Path) -> None:
    _configs(tmp_path)
    blocks = [*_blocks("sh"), *_blocks("sh", RIGS)]
    commands = [line for block in blocks for line in block.splitlines()]
    gonio = [line.split()[1:] for line in commands if line.startswith("gonio ")]
    assert len(gonio) >= 9
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


def test_the_python_examples_run_in_the_order_given(tmp_path: Path) -> None:
    _configs(tmp_path)
    blocks = _blocks("python")
    assert blocks
    for block in blocks:
        assert len(block.strip().splitlines()) <= 12
        command = [sys.executable, "-W", "error", "-c", block]
        done = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "runs/python/brdf.png").stat().st_size > 10_000


def test_the_readme_is_short_enough_to_be_read() -> None:
    lines = README.splitlines()
    assert len(lines) <= 130
