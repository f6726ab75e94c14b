"""The command that boots the emulated computer, on a machine that lacks something."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.hil_emulated import __main__ as command
from tests.hil_emulated.host.kernel import Kernel


@pytest.mark.parametrize("lacking", ["qemu-system-x86_64", "cpio", "linux-image"])
def test_what_the_machine_lacks_is_named_in_one_line_and_nothing_boots(
    lacking: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "_run", lambda *_: pytest.fail("it boots"))
    monkeypatch.setattr(command, "installed_kernel", lambda: None)
    if lacking != "linux-image":
        monkeypatch.setattr(shutil, "which", lambda tool: None if tool == lacking else f"/{tool}")
    assert command.main() == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("emulated computer: skipped: not installed (Debian: ")
    assert lacking.removesuffix("_64") in line


def test_a_kernel_that_may_not_be_read_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As for users other than root on some distributions."""
    image = tmp_path / "vmlinuz-6.1.0"
    monkeypatch.setattr(command, "installed_kernel", lambda: Kernel("6.1.0", image, tmp_path))
    monkeypatch.setattr(shutil, "which", lambda tool: f"/{tool}")
    assert command.main() == 0
    assert f"skipped: {image} may not be read: run it as root" in capsys.readouterr().out


def test_the_guest_runs_the_tests_for_a_bench_and_leaves_their_exit_code() -> None:
    script = command._start(["--slow", "-k", "two words"], calls=1234, usb=5678)
    assert "export GONIO_EMULATED_BENCH=10.0.2.2:1234" in script
    assert "export GONIO_EMULATED_USB=10.0.2.2:5678" in script
    assert "-m hil --allow-motion" in script
    assert "--slow -k 'two words' tests/drivers/test_camera_contract.py" in script
    assert script.endswith("\necho $? > /out/exit_code")
