"""Commands `gonio new rig` and `gonio new protocol`: write a commented file from questions."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from acquisition.drafts.checks import protocol_draft, rig_draft, scan_of
from acquisition.drafts.interview import Ask, Draft, Interview
from acquisition.drafts.rig_questions import Bench
from acquisition.terminal.console import ask, console, print_lines
from acquisition.terminal.orderly_end import orderly_end
from instrument.calibration.archive import SUFFIX
from instrument.calibration.camera_file import is_camera_file
from instrument.calibration.geometry_file import is_geometry_file
from instrument.calibration.lamp_file import is_lamp_file
from instrument.config.load import load_rig
from instrument.errors import InputError
from instrument.text.atomic_file import write_whole
from instrument.text.quoting import shown

_SUFFIXES = (".yaml", ".yml")
_HEAD = "Enter takes the value in brackets, a number one of those listed; q ends without a file."
_MOST_OFFERED = 9  # calibrations, the newest first


def new_rig(path: Path | None, given: Sequence[str], *, defaults: bool, identify: bool) -> None:
    """Ask for a rig and write its file. `identify`: query every serial port first."""
    path = _new_path("rig", path)
    answers = _by_key(given)
    from drivers.discovery import found_cameras, found_ports

    bench = Bench(
        folder=path.parent,
        name=path.stem,
        cameras=found_cameras(),
        ports=found_ports(identify),
        calibrations=_newest(path.parent, is_camera_file),
        lamp_calibrations=_newest(path.parent, is_lamp_file),
        geometries=_newest(path.parent, is_geometry_file),
    )
    _write(path, answers, defaults, lambda scratch: rig_draft(bench, scratch))
    print_lines([f"file: {path}", f"next: gonio new protocol --rig {path} -o protocol.yaml"])


def new_protocol(
    path: Path | None, rig_path: Path | None, given: Sequence[str], *, defaults: bool
) -> None:
    """Ask for a scan of a rig and write its protocol."""
    path = _new_path("protocol", path)
    if rig_path is None:
        raise InputError("gonio new protocol: name the rig file: --rig FILE (gonio new rig)")
    answers = _by_key(given)
    scan = scan_of(path.stem, load_rig(rig_path), rig_path, path.parent)
    _write(path, answers, defaults, lambda scratch: protocol_draft(scan, scratch))
    print_lines([f"file: {path}", f"next: gonio plan {path}"])


def _write(
    path: Path, given: dict[str, str], defaults: bool, draft: Callable[[Path], Draft]
) -> None:
    """Ask the questions of a draft, and write the file whole, unless the name was taken since."""
    with orderly_end(), TemporaryDirectory(prefix="gonio-new-") as scratch:
        interview = Interview(given=given, ask=_asker(defaults), say=_say)
        write_whole(path, interview.text_of(draft(Path(scratch))), new=True)


def _asker(defaults: bool) -> Ask | None:
    """Return the function that asks a person; None where there is nobody, or nothing to ask."""
    if defaults or not sys.stdin.isatty():
        return None
    _say(_HEAD)
    return ask


def _say(text: str) -> None:
    console.print(text, highlight=False, soft_wrap=True)


def _new_path(kind: str, path: Path | None) -> Path:
    """Return the path of the file to be; raise `InputError` before anything is asked."""
    if path is None:
        raise InputError(f"gonio new {kind}: name the file to write: -o FILE.yaml")
    if path.suffix not in _SUFFIXES:
        raise InputError(f"{path}: the file's name must end in {' or '.join(_SUFFIXES)}")
    if path.exists() or path.is_symlink():
        raise InputError(f"{path}: exists already: choose another name")
    if not path.parent.is_dir():
        raise InputError(f"{path}: there is no folder {path.parent}: make it first")
    return path


def _by_key(given: Sequence[str]) -> dict[str, str]:
    """Return the answers of the options --set by their keys."""
    answers: dict[str, str] = {}
    for item in given:
        key, equals, value = item.partition("=")
        if not equals or not value.strip():
            raise InputError(f"--set {shown(item)}; allowed: KEY=VALUE, such as name=bench")
        if key in answers:
            raise InputError(f"--set {key}: is given twice; allowed: once")
        answers[key] = value.strip()
    return answers


def _newest(folder: Path, is_one: Callable[[Path], bool]) -> list[Path]:
    """Return the calibrations of one kind in a folder, the newest first."""
    found = [path for path in folder.glob(f"*{SUFFIX}") if path.is_file() and is_one(path)]
    found.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    return found[:_MOST_OFFERED]
