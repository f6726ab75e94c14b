"""Files of a benchmark: JSON and CSV tables hold all trials."""

from __future__ import annotations

import csv
import io
import json

import pytest

from acquisition.benchmark.output.files import from_json, table, to_json
from instrument.errors import InputError
from tests.support.benchmark import result


def test_the_json_holds_everything_but_the_maps() -> None:
    text = to_json(result())
    assert json.loads(text)["schema"] == 1
    assert from_json(text) == result()
    with pytest.raises(InputError, match=r"bench.json: schema 2; allowed: 1"):
        from_json(text.replace('"schema": 1', '"schema": 2'))


def test_a_table_has_one_row_per_trial() -> None:
    study = result().studies[0]
    rows = list(csv.DictReader(io.StringIO(table(study))))
    assert len(rows) == len(study.trials)
    usual = next(row for row in rows if row["label"] == "usual")
    assert (usual["default"], usual["on_front"], usual["u_relative"]) == ("yes", "yes", "0.25")
    assert next(row for row in rows if row["label"] == "fails")["error"] == "inf"
