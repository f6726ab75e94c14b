"""The command line: usage, errors as exit codes, and the place that modules come from."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
import typer

from acquisition.cli import errors_as_exit_codes
from instrument.errors import DeviceError, InputError, NotDetermined, OperatorStop, StorageError
from tests.support.command import gonio_here as gonio
from tests.support.scans import small_demo

DEADLINE_S = 60.0


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (InputError("a.yaml:1:2: wrong", "a.yaml:3:4: wrong"), 2, "a.yaml:3:4: wrong"),
        (DeviceError("theta_r: stalled"), 3, "theta_r: stalled"),
        (StorageError("disk full"), 3, "disk full"),
        (PermissionError(13, "Permission denied", "run"), 3, "Permission denied: 'run'"),
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
    command = "import sys; sys.path.pop(0); from acquisition.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", command, "run", small_demo(tmp_path), "--out", tmp_path / "run"],
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
