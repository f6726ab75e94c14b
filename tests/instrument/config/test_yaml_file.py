"""A file that cannot be read is named, with the files beside it."""

import os
from pathlib import Path

import pytest

from instrument.config.load import load_protocol
from instrument.errors import InputError
from tests.support.config.texts import load


def message_of(path: Path, rig: Path | None = None) -> str:
    with pytest.raises(InputError) as caught:
        load_protocol(path, rig)
    return str(caught.value)


def test_a_missing_file_names_similar_ones() -> None:
    load()
    assert message_of(Path("protcol.yaml")) == (
        "protcol.yaml: no such file; in . there is protocol.yaml"
    )
    assert message_of(Path("x.yaml")).endswith("in . there is protocol.yaml, rig.yaml")
    assert "there is no readable folder none" in message_of(Path("none/x.yaml"))


def test_a_folder_is_no_file() -> None:
    Path("configs").mkdir()
    Path("configs/a.yaml").write_text("")
    assert message_of(Path("configs")) == (
        "configs: is a folder; allowed: a YAML file; in configs there is a.yaml"
    )


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read every file")
def test_a_file_that_may_not_be_read() -> None:
    Path("secret.yaml").write_text("a: 1")
    Path("secret.yaml").chmod(0)
    assert message_of(Path("secret.yaml")).startswith("secret.yaml: cannot be read: Permission")


def test_a_name_with_control_characters_is_shown_harmless() -> None:
    assert "\x1b" not in message_of(Path("a\x1b[2J.yaml"))
