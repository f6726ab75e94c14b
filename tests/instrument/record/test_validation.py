"""Validation of records from elsewhere: damage, forged values and changed schemas are refused."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from instrument.errors import InputError
from instrument.record import validation
from instrument.record.record import FILE_NAME, Record
from instrument.record.schema import TABLES
from tests.support.storage.sample_records import small_record
from tests.support.strangers.mutations import Mutator, feed
from tests.support.strangers.run_folders import REFUSED, Sent, copy_of


@pytest.fixture(scope="module", params=[6, 5, 4, 3])
def received(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """Folder of a small record in each schema version."""
    folder = tmp_path_factory.mktemp("received")
    small_record(folder / "run").close()
    return copy_of(folder / "run", folder, request.param).folder


@pytest.fixture
def sent(received: Path, tmp_path: Path) -> Sent:
    """A copy of it, to be changed."""
    return copy_of(received, tmp_path)


def test_a_sound_record_of_each_version_opens(sent: Sent) -> None:
    with Record.open(sent.folder) as record:
        assert [r.step for r in record.readings()] == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("what", REFUSED)
def test_a_forged_or_damaged_record_is_refused_by_name(sent: Sent, what: str) -> None:
    change, words = REFUSED[what]
    change(sent)
    with pytest.raises(InputError) as refused:
        Record.open(sent.folder)
    assert words in str(refused.value)
    assert str(sent.folder) in str(refused.value)


@pytest.mark.parametrize(
    ("old", "new"), [(") STRICT", ")"), (" CHECK (signal_dn BETWEEN -1e+30 AND 1e+30)", "")]
)
def test_a_schema_with_fewer_rules_is_unknown(tmp_path: Path, old: str, new: str) -> None:
    """Nothing in it would be verified."""
    small_record(tmp_path / "run").close()
    sent = copy_of(tmp_path / "run", tmp_path)
    sent.widen(old, new)
    with pytest.raises(InputError, match="which this program did not create so"):
        Record.open(sent.folder)


def test_a_schema_of_one_version_under_the_number_of_another_is_refused(sent: Sent) -> None:
    other = "CASE value WHEN '4' THEN '5' ELSE '4' END"
    sent.forge(f"UPDATE meta SET value = {other} WHERE key = 'schema_version'")
    with pytest.raises(InputError, match="the table 'meta', which this program did not create"):
        Record.open(sent.folder)


def test_a_wrong_value_is_named_with_table_row_column_and_what_is_allowed(sent: Sent) -> None:
    sent.forge("UPDATE drift_at_resume SET theta_r_deg = -95.0")
    words = (
        f"{sent.record}: drift_at_resume 3: theta_r_deg is -95.0; allowed: a number from -89.5 "
        "to 89.5: take an undamaged copy of the run"
    )
    with pytest.raises(InputError) as refused:
        Record.open(sent.folder)
    assert str(refused.value) == words


def test_previews_too_large_together_are_refused(
    sent: Sent, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The limit itself is 512 MB; it is smaller here, so that less is written."""
    monkeypatch.setattr(validation, "_MOST_PREVIEW_BYTES", 9_000_000)
    sent.forge("UPDATE preview SET png = zeroblob(2000000)")
    with pytest.raises(InputError, match="pictures of 10000000 bytes; allowed: 9000000"):
        Record.open(sent.folder)


def test_a_text_too_large_is_refused(sent: Sent, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("instrument.record.schema.MOST_BYTES", 1_000_000)
    sent.forge("UPDATE event SET text = CAST(zeroblob(2000000) AS TEXT)")
    with pytest.raises(InputError, match="not a record of this program: string or blob too big"):
        Record.open(sent.folder)


def test_more_than_can_be_reduced_is_refused(sent: Sent, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(validation, "MOST_WORK", 1)
    with pytest.raises(InputError, match=r"readings, .* are too many"):
        Record.open(sent.folder)


COLUMNS = [column.name for column in TABLES["reading"]]


def _numbered(column: str) -> str:
    kind = "CASE WHEN i % 25 THEN 'point' ELSE 'drift' END"
    return {"step": "i", "time_s": "CAST(i AS REAL)", "kind": kind}.get(column, column)


@pytest.mark.slow
def test_a_scan_of_60_000_points_with_a_drift_check_every_25_opens(
    tmp_path: Path, slow: bool
) -> None:
    """It is not too many: reduction is linear in the drift checks, see `test_soak`.

    Without --slow a fifth of them.
    """
    count = 62_400 if slow else 12_500
    small_record(tmp_path / "run").close()
    sent = copy_of(tmp_path / "run", tmp_path)
    sent.sql(
        "DELETE FROM reading WHERE step > 0",
        f"WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {count}) "
        f"INSERT INTO reading SELECT {', '.join(_numbered(name) for name in COLUMNS)}, 0 "
        "FROM reading, n",
    )
    with Record.open(sent.folder) as record:
        kinds = [r.kind for r in record.readings()]
    assert (kinds.count("point"), kinds.count("drift")) == (count * 24 // 25, count // 25 + 1)


@pytest.mark.slow
def test_any_damage_to_a_record_gives_a_result_or_an_input_error(sent: Sent, slow: bool) -> None:
    """All readers of a record are called."""

    def read(data: bytes) -> None:
        for name in ("", "-wal", "-shm"):
            (sent.folder / f"{FILE_NAME}{name}").unlink(missing_ok=True)
        sent.record.write_bytes(data)
        said = str(sent.folder)
        try:
            with Record.open(sent.folder) as record:
                contents = (record.readings(), record.previews(), record.devices(), record.darks())
                assert all(part is not None for part in contents)
        except InputError as error:
            said = str(error)
        assert said.startswith(str(sent.folder))

    whole = sent.record.read_bytes()
    spoilt = Mutator([whole], 7)

    def spoil(number: int) -> bytes:
        """Bytes damaged here and there, which leaves most of the file whole, or anything."""
        rng = random.Random(number)
        if number % 4 == 0:
            return spoilt(number)
        data = bytearray(whole)
        for _ in range(rng.randint(1, 30)):
            at = rng.randrange(len(data) if number % 2 else 100)
            data[at] = rng.randrange(256)
        return bytes(data)

    feed(spoil, 1000 if slow else 30, read)
