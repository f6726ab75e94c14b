"""Hostile files, names and replies are data: they are read and shown, never executed."""

from __future__ import annotations

import io
import os
import re
import time
from pathlib import Path

import pytest

from acquisition.results.run_folder import default_folder
from acquisition.terminal.console import EscapingConsole
from analysis.data.csv.table import read_csv
from analysis.report.data import ReportData
from analysis.report.page import report_html
from instrument.config.load import Loaded, load_protocol
from instrument.config.yaml_positions import MAX_BYTES
from instrument.errors import DeviceError, InputError
from instrument.text.terminal_safe import first_unfit
from tests.support.analysis.csv_texts import BARE
from tests.support.config.texts import PROTOCOL, RIG
from tests.support.stages.memory_stages import in_memory

HARMFUL = "\x1b]0;mine\x07\x1b[2J\u202e[bold red]:skull:[link=http://x]here[/link]\r"


TEXT = PROTOCOL.replace("rig: rig.yaml\n", "description: none\nrig: rig.yaml\n")


def protocol(folder: Path, old: str, new: str) -> Loaded:
    """Load the small protocol with one text replaced, and its rig."""
    assert TEXT.count(old) == 1
    (folder / "p.yaml").write_text(TEXT.replace(old, new))
    (folder / "rig.yaml").write_text(RIG)
    return load_protocol(folder / "p.yaml")


def refusal(folder: Path, old: str, new: str) -> str:
    with pytest.raises(InputError) as refused:
        protocol(folder, old, new)
    return str(refused.value)


# YAML.


@pytest.mark.parametrize(
    "value",
    [
        "!!python/object/apply:os.mkdir [executed]",
        "!!python/object/new:os.mkdir [executed]",
        "!!python/name:os.mkdir",
        "!!python/module:executed",
        "!!binary aGVsbG8=",
        "!!timestamp 2026-01-01",
        "!mine {a: 1}",
    ],
)
def test_a_yaml_tag_is_a_mistake_and_runs_nothing(
    value: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = refusal(tmp_path, "description: none", f"description: {value}")
    assert said.startswith(f"{tmp_path / 'p.yaml'}:2:14: description: tag '")
    assert "is not supported; write the plain value" in said
    assert not (tmp_path / "executed").exists()


BOMBS = {
    "laughs": "\n".join(
        ["a0: &a0 [x, x]"] + [f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]" for n in range(1, 300)]
    ),
    "merge keys": "\n".join(
        ["a0: &a0 {k: v}"] + [f"a{n}: &a{n} {{<<: [*a{n - 1}, *a{n - 1}]}}" for n in range(1, 300)]
    ),
    "an alias of itself": "a: &a [*a, *a]",
    "aliases for every angle": PROTOCOL.replace("[30, ", "[&a 30.0, " + "*a, " * 3000),
}


@pytest.mark.parametrize("name", BOMBS)
def test_yaml_aliases_are_never_expanded(name: str, tmp_path: Path) -> None:
    """In less time than the expansion of the 40th level would take, and with its position."""
    path, rig = tmp_path / "p.yaml", tmp_path / "rig.yaml"
    path.write_text(BOMBS[name])
    rig.write_text(RIG)
    began_s = time.process_time()
    with pytest.raises(
        InputError, match=r"(anchor|alias|merge key) .* is not supported"
    ) as refused:
        load_protocol(path, rig)
    assert time.process_time() - began_s < 10
    assert len(str(refused.value)) < 60_000


def test_the_time_for_refused_values_is_linear(tmp_path: Path) -> None:
    """Ten times as many aliases must not take a hundred times as long."""
    (tmp_path / "rig.yaml").write_text(RIG)

    def took_s(count: int) -> float:
        text = f"sweeps:\n  - theta_r_deg: [&a 1.0, {'*a, ' * count}]\n"
        (tmp_path / "p.yaml").write_text(text)
        began_s = time.process_time()
        with pytest.raises(InputError):
            load_protocol(tmp_path / "p.yaml", tmp_path / "rig.yaml")
        return time.process_time() - began_s

    took_s(10)
    assert took_s(5000) < 30 * took_s(500)


# Paths.


@pytest.mark.parametrize("rig", ["/dev/zero", "/dev/stdin", "/dev/tty", "pipe", "socket", "link"])
def test_a_device_or_a_pipe_is_refused_as_a_rig_file(rig: str, tmp_path: Path) -> None:
    """It is not even opened: reading some would block for ever."""
    os.mkfifo(tmp_path / "pipe")
    os.mknod(tmp_path / "socket", 0o140600)
    (tmp_path / "link").symlink_to("/dev/zero")
    said = refusal(tmp_path, "rig: rig.yaml", f"rig: {rig}")
    assert "cannot be read: it is a device, a pipe or a socket, not a file" in said
    os.mkfifo(tmp_path / "p2.yaml")
    with pytest.raises(InputError, match="it is a device"):
        load_protocol(tmp_path / "p2.yaml")


def test_a_message_about_another_file_does_not_show_its_contents(tmp_path: Path) -> None:
    """A protocol may name any file as its rig, such as a list of passwords."""
    lines = [f"user{n}:x:{n}:{n}:secret number {n}:/home/user{n}:/bin/sh" for n in range(500)]
    (tmp_path / "passwd").write_text("\n".join(lines))
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    for path in ("../../passwd", str(tmp_path / "passwd")):
        said = refusal(inner, "rig: rig.yaml", f"rig: {path}")
        assert "allowed: a block of `key: value` lines" in said
        assert "secret" not in said
        assert len(said) < 1000
    (tmp_path / "passwd").write_text("password: secret\nothers: [secret, secret]\n")
    assert "secret" not in refusal(inner, "rig: rig.yaml", "rig: ../../passwd")


def test_a_large_file_is_refused_without_being_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    with path.open("wb") as file:
        file.truncate(50 * 1024**3)  # takes no space
    with pytest.raises(InputError, match=f"too large; allowed: {MAX_BYTES // 1024} kB"):
        load_protocol(path)
    with pytest.raises(InputError, match="the file is too large; allowed: 64 MB"):
        read_csv(path)


# Names.


@pytest.mark.parametrize("escape", ["\\e[2J", "\\x07", "\\r", "\\0", "\\x9b", "\\u202e", "\\L"])
def test_a_name_with_a_control_character_is_refused(escape: str, tmp_path: Path) -> None:
    said = refusal(tmp_path, "description: none", f'description: "a{escape}b"')
    assert "holds a control character" in said
    assert first_unfit(said) is None
    key = refusal(tmp_path, "description: none", f'"a{escape}b": none')
    assert first_unfit(key) is None


def test_a_name_has_one_line(tmp_path: Path) -> None:
    """A second line could look like a prompt of the program itself."""
    said = refusal(tmp_path, "name: foam\n", 'name: "a\\nGo on? y"\n')
    assert "name: 'a\\nGo on? y' has more than one line" in said
    described = protocol(tmp_path, "description: none", 'description: "one\\ntwo"')
    assert described.protocol.description == "one\ntwo"


def test_a_name_does_not_change_the_folder_of_the_run(tmp_path: Path) -> None:
    """The folder is named after the protocol's file, not after the name in it."""
    loaded = protocol(tmp_path, "name: foam\n", "name: ../../../x/\n")
    folder = default_folder(loaded)
    assert folder.parent == Path("runs")
    assert folder.name.startswith("p-")


def test_the_terminal_shows_control_characters_and_markup_as_text() -> None:
    shown = io.StringIO()
    EscapingConsole(file=shown, markup=False, emoji=False, force_terminal=True, width=200).print(
        HARMFUL, highlight=False
    )
    text = shown.getvalue()
    assert "\\x1b[2J" in text
    assert "\\u202e" in text
    assert "[bold red]:skull:[link=http://x]here[/link]" in text
    assert first_unfit(text) is None


def test_the_report_escapes_html_in_names() -> None:
    import numpy as np

    bad = '</title><script>alert(1)</script>"><img src=x onerror=alert(1)>'
    one = np.ones(1)
    page = report_html(
        ReportData(
            title=bad, sample=bad, description=bad, verdict=(bad,), verdict_kind="", notes=(bad,),
            theta_i_deg=one, dphi_deg=one, theta_r_deg=one, brdf=one, u_brdf=one, radiance=one,
            u_radiance=one, flags=(bad,), fitted=np.array([False]), budget=((bad, 1.0, 100.0),),
            rig=((bad, bad),), devices=((bad, bad),), versions=((bad, bad),), times=((bad, bad),),
        )
    )  # fmt: skip
    # The values of the points, which no browser runs, and the program's own script.
    ours = ['<script type="application/json" id="points">', "<script>"]
    assert re.findall(r"<script[^>]*>", page) == ours
    assert "<img" not in page
    assert page.count("&lt;script&gt;") >= 12


def test_a_message_about_a_zaber_reply_has_no_control_characters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The reply has a valid checksum; it is refused all the same, and not shown."""
    memory = in_memory("zaber", monkeypatch)

    def coloured(answer: bytes) -> bytes:
        body = answer[1 : answer.index(b":")] + b"\x1b[2J"
        return b"@%b:%02X\r\n" % (body, -sum(body) & 0xFF)

    memory.wire.spoil = coloured
    with pytest.raises(DeviceError) as failed:
        memory.open()
    assert first_unfit(str(failed.value)) is None


# Tables.


def test_a_line_of_50_mb_and_a_million_columns_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(BARE.encode() + b"1," * 25_000_000)
    with pytest.raises(InputError, match=r"a\.csv:4:1: a line of 50000000 characters; allowed: "):
        read_csv(path)
    path.write_bytes(b"theta_i_deg," * 80_000)
    with pytest.raises(InputError, match=r"a\.csv:1:1: header: 80001 columns; allowed: 1000"):
        read_csv(path)


def test_reading_of_a_table_stops_after_many_mistakes(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(BARE.encode() + b"xy\n" * 100_000)
    with pytest.raises(InputError) as refused:
        read_csv(path)
    assert refused.value.problems[-1].startswith("... and at least 9997 more like ")
    path.write_bytes(BARE.encode() + b"\n" * 3_000_000)
    with pytest.raises(InputError, match="lines; allowed: 2000000; split it"):
        read_csv(path)
