"""Roles of configuration files: which of a protocol and a rig file one is."""

from __future__ import annotations

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from instrument.config.file_role import wrong_role
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.config.section import Section
from tests.support.config.texts import PROTOCOL, RIG

FILES = {Protocol: yaml.safe_load(PROTOCOL), Rig: yaml.safe_load(RIG)}


@given(st.data(), st.sampled_from([Protocol, Rig]), st.sampled_from([Protocol, Rig]))
def test_a_part_of_a_file_keeps_its_role(
    data: st.DataObject, given: type[Section], wanted: type[Section]
) -> None:
    """Missing keys and a misspelt one are mistakes of the file, whose role stays plain."""
    own = [key for key in FILES[given] if key not in ("name", "description")]
    keys = data.draw(st.lists(st.sampled_from(own), min_size=2, unique=True))
    part = {key: FILES[given][key] for key in [*keys, "name"]} | {"misspelt": 1}
    assert (wrong_role(part, wanted) is None) == (given is wanted)


@pytest.mark.parametrize("data", [None, {}, [], "text", {"name": "foam"}, {"name": 1, "x": 2}])
def test_a_file_without_keys_of_another_role_is_checked_key_by_key(data: object) -> None:
    assert wrong_role(data, Protocol) is None
    assert wrong_role(data, Rig) is None


def test_keys_that_belong_nowhere_are_quoted_short() -> None:
    text = wrong_role({"\x1b[31m": 1, "y" * 99: 2}, Protocol)
    assert text is not None
    assert text.startswith(rf"is not a protocol (keys '\x1b[31m', {'y' * 40}); allowed: a protocol")
