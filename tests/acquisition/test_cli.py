"""The command line: usage, errors as exit codes, and the place that modules come from."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
import typer

from acquisition.cli_parts import errors_as_exit_codes
from instrument.errors import DeviceError, InputError, NotDetermined, OperatorStop, StorageError
from tests.support.command import gonio_here as gonio
from tests.support.paths import CONFIGS
from tests.support.scans import TWO_MODELS, small_demo

DEADLINE_S = 300.0
PROTOCOL = CONFIGS / "protocols" / "demo.yaml"


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (InputError("a.yaml:1:2: wrong", "a.yaml:3:4: wrong"), 2, "a.yaml:3:4: wrong"),
        (DeviceError("theta_r: stalled"), 3, "theta_r: stalled"),
        (StorageError("disk full"), 3, "disk full"),
        (PermissionError(13, "Permission denied", "run"), 3, "Permission denied: 'run'"),
        (OSError(36, "File name too long", "x" * 300), 2, "xxx...: too long (300 bytes); allowed:"),
        (
            MemoryError("Unable to allocate 9 GiB"),
            3,
            "out of memory (Unable to allocate 9 GiB): free",
        ),
        (MemoryError(), 3, "out of memory (no details): free memory, raise the limit"),
        (ImportError("cv2.so: failed to map segment from shared object"), 3, "out of memory (cv2"),
        (RuntimeError("can't start new thread"), 3, "out of memory (can't start new thread)"),
        (OperatorStop("stopped at the prompt"), 4, "stopped at the prompt"),
        (KeyboardInterrupt(), 4, "stopped by the operator"),
        (NotDetermined("two points"), 5, "two points"),
        (DeviceError("answer \x1b[2J"), 3, "answer \\x1b[2J"),  # no command to the terminal
    ],
)
def test_an_error_is_a_message_and_an_exit_code(
    error: BaseException, code: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit) as ended, errors_as_exit_codes():
        raise error
    assert ended.value.exit_code == code
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("error", [ImportError("no module"), RuntimeError("a mistake")])
def test_a_mistake_of_the_program_is_not_disguised(error: Exception) -> None:
    with pytest.raises(type(error), match=str(error)), errors_as_exit_codes():
        raise error


@pytest.mark.parametrize(
    "command", [("run", PROTOCOL, "--out"), ("resume",), ("report",), ("fit",)]
)
@pytest.mark.parametrize("name", ["x" * 300, "/".join(["y" * 200] * 30)])
def test_a_path_that_is_too_long_is_wrong_input(
    command: tuple[object, ...], name: str, tmp_path: Path
) -> None:
    done = gonio(*command, tmp_path / name)
    assert done.returncode == 2
    assert "too long" in done.stderr
    assert "allowed: names of up to 255 bytes" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_usage_errors_exit_with_2() -> None:
    assert gonio("fly").returncode == 2
    assert gonio("run").returncode == 2
    missing = gonio("run", "no_such_protocol.yaml")
    assert missing.returncode == 2
    assert "no_such_protocol.yaml" in missing.stderr


def test_no_module_is_imported_from_the_working_folder(
    tmp_path: Path,
) -> None:
    (tmp_path / "analysis.py").write_text("raise SystemExit('not this one')")
    protocol = small_demo(tmp_path, TWO_MODELS)
    command = "import sys; sys.path.pop(0); from acquisition.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", command, "run", protocol, "--out", tmp_path / "run"],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=DEADLINE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_version_and_both_forms_of_help_are_known() -> None:
    shown = gonio("--version")
    assert (shown.returncode, shown.stdout.split()[:2]) == (0, ["gonio", version("gonio")])
    for command in ((), ("fit",), ("move",)):
        short, long = gonio(*command, "-h"), gonio(*command, "--help")
        assert short.returncode == long.returncode == 0
        assert short.stdout == long.stdout
        assert "-h, --help" in long.stdout


@pytest.mark.parametrize(
    ("words", "completed"),
    [
        ("gonio re", ["report", "resume"]),
        ("gonio home th", ["theta_i", "theta_r"]),
        ("gonio fit x.csv --method e", ["exact"]),
        ("gonio fit x.csv --models lambert,minn", ["lambert,minnaert"]),
    ],
)
def test_the_shell_completes_commands_and_words(
    words: str, completed: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As bash asks, by the script that `gonio --show-completion bash` prints."""
    monkeypatch.setenv("_GONIO_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    found = gonio().stdout.split()
    assert [word for word in sorted(found) if "+" not in word] == completed
