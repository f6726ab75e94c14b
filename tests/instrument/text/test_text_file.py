"""Text files: encodings, files that cannot be read, and limits."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from analysis.data.csv.table import read_csv
from instrument.errors import InputError
from instrument.text import text_file
from tests.support.analysis.csv_texts import BARE, problems, read


def test_three_mistakes_of_a_kind_are_listed_and_the_others_counted() -> None:
    rows = "".join(f"{n},0,0,x\n" for n in range(21))
    found = problems("theta_i_deg,theta_r_deg,dphi_deg,brdf\n" + rows)
    assert [line.split(":")[1] for line in found[:-1]] == ["2", "3", "4"]
    assert found[-1] == "... and 18 more like data.csv:4:7"
    other = problems("theta_i_deg,theta_r_deg,dphi_deg,brdf\n" + rows + "95,0,0,1\n")
    assert other[3].startswith("data.csv:23:1: theta_i_deg: 95 deg")  # the only one of its kind
    assert other[-1] == found[-1]


def test_no_more_than_twenty_mistakes_are_listed() -> None:
    names = [f"u_shared_e{n * 'x'}_relative" for n in range(21)]
    header = ",".join(["theta_i_deg,theta_r_deg,dphi_deg,brdf", *names])
    found = problems(f"{header}\n30,0,0,.2{21 * ',x'}\n")
    assert len(found) == 20 + 1
    assert found[-1] == "... and 1 more of other kinds"


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_text_that_is_not_utf_8(mark: bytes, end: bytes) -> None:
    content = BARE.replace("0.24", "0.24é °").encode().replace(b"\n", end)
    broken = content.replace("°".encode(), b"\xb0")
    assert problems(mark + broken) == (
        "data.csv:3:15: byte 0xb0 is not UTF-8 text; save the file as UTF-8",
    )


def test_a_table_in_utf_16_is_not_guessed() -> None:
    assert problems(BARE.encode("utf-16"))[0].startswith("data.csv:1:1: is text in UTF-16; allowed")


def test_a_file_that_cannot_be_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    def problem(path: str) -> str:
        with pytest.raises(InputError) as caught:
            read_csv(Path(path))
        return str(caught.value)

    assert problem("nowhere.csv") == "nowhere.csv: no such file; check its name and folder"
    assert problem(".") == ".: is a folder; allowed: a text file"
    Path("file").touch()
    assert problem("file/a.csv").startswith("file/a.csv: cannot be read: Not a directory; check")
    assert problem("a\0b").startswith("'a\\x00b': cannot be read: embedded null byte; check")

    def refuse(*_: object) -> None:
        raise PermissionError(13, os.strerror(13))

    Path("secret.csv").touch()
    monkeypatch.setattr(Path, "open", refuse)
    words = "secret.csv: cannot be read: Permission denied; check its name and permissions"
    assert problem("secret.csv") == words


def test_a_file_that_is_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    assert text_file.MAX_BYTES == 64 * 1024**2
    monkeypatch.setattr(text_file, "MAX_BYTES", 1024**2)
    fitting = (BARE + "#").ljust(1024**2, "x")
    assert read(fitting).size == 2
    assert problems(fitting + "x") == ("data.csv: the file is too large; allowed: 1 MB; split it",)
