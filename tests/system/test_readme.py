"""Every command and example in the README and in the document on rigs works."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from instrument.config.load import load_protocol
from tests.support.command import gonio_here
from tests.support.paths import CONFIGS, ROOT
from tests.support.scans import small_rig

README = (ROOT / "README.md").read_text()


RIGS = (ROOT / "docs" / "rigs.md").read_text()


def _blocks(language: str, text: str = README) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def _configs(folder: Path) -> None:
    """Copy the rigs and protocols; those that run have short scans of simple surfaces.

    And a quarter of the pixels. The commands and examples prove no more with whole scans;
    `test_samples` has these.
    """
    shutil.copytree(CONFIGS, folder / "configs")
    rigs = folder / "configs" / "rigs"
    small_rig(rigs, shrink=2).replace(rigs / "bench_12bit.yaml")
    for name in ("plaster_a", "demo"):
        path = folder / "configs" / "protocols" / f"{name}.yaml"
        text = path.read_text().replace("[30.0, 45.0, 60.0]", "[30.0, 60.0]")
        text = re.sub(r"num: \d+", "num: 9", text).replace("oren_nayar_exact", "oren_nayar")
        path.write_text(f"{text}fit: {{models: [lambert, oren_nayar]}}\n")


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


def test_the_python_examples_run_in_the_order_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    _configs(tmp_path)
    blocks = _blocks("python")
    assert blocks
    for block in blocks:
        assert len(block.strip().splitlines()) <= 12
        exec(compile(block, "README.md", "exec"), {})
    assert (tmp_path / "runs/python/brdf.png").stat().st_size > 10_000


def test_the_readme_is_short_enough_to_be_read() -> None:
    lines = README.splitlines()
    assert len(lines) <= 130
