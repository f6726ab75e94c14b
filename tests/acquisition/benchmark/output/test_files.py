"""Files of a benchmark: JSON and CSV tables hold all trials."""

from __future__ import annotations

import csv
import io
import json

from acquisition.benchmark.output.files import table, to_json
from tests.support.benchmark import from_json, result


def test_the_json_holds_everything_but_the_maps() -> None:
    text = to_json(result())
    assert json.loads(text)["schema"] == 1
    assert from_json(text) == result()


def test_a_table_has_one_row_per_trial() -> None:
    study = result().studies[0]
    rows = list(csv.DictReader(io.StringIO(table(study))))
    assert len(rows) == len(study.trials)
    usual = next(row for row in rows if row["label"] == "usual")
    assert (usual["default"], usual["on_front"], usual["u_relative"]) == ("yes", "yes", "0.25")
    assert next(row for row in rows if row["label"] == "fails")["error"] == "inf"
