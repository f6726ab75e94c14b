"""Kinds of files by their first bytes; `tests/system/strangers/test_wrong_files.py` has each."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from instrument.text.file_kind import foreign_kind
from tests.support.analysis.csv_texts import NAMES
from tests.support.paths import CONFIGS


@given(st.permutations(NAMES), st.sampled_from(["", "# ", "\ufeff", "\n \n", '"']))
def test_a_table_is_no_other_kind(names: list[str], before: str) -> None:
    raw = (before + ",".join(names)).encode()
    assert foreign_kind(raw) is None


def test_a_configuration_file_is_no_other_kind() -> None:
    files = list(CONFIGS.rglob("*.yaml"))
    assert files
    assert {foreign_kind(path.read_bytes()) for path in files} == {None}
