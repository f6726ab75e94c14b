"""What a bench leaves behind: bench.json, a CSV table for each study, the page, the main chart."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from acquisition.benchmark.output.charts import alone, main_chart
from acquisition.benchmark.output.page import page
from acquisition.benchmark.result import Bench, BenchFiles, MapPicture
from acquisition.benchmark.study import Study
from acquisition.benchmark.trial import Trial, pareto_front
from instrument.errors import InputError
from instrument.text.atomic_file import write_whole

SCHEMA = 1
"""Of bench.json: counted up when a field is renamed or means something else."""

_COLUMNS = tuple(f.name for f in fields(Trial) if f.name != "more")


def empty_folder(folder: Path) -> None:
    """Make the folder. Raises `InputError` where it is there already and not empty."""
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(f"{folder}: --out must be absent or an empty folder: name another")
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot write the bench there: {error}") from error


def write(bench: Bench, folder: Path) -> BenchFiles:
    """Write all files of a bench into a folder that is there."""
    left = BenchFiles(
        folder, folder / "bench.html", folder / "bench.json", folder / "main_chart.svg"
    )
    write_whole(left.json, to_json(bench))
    for study in bench.studies:
        write_whole(folder / f"{study.name}.csv", table(study))
    for number, picture in enumerate(bench.maps, start=1):
        write_whole(folder / f"map_{number}.csv", map_table(picture))
    write_whole(left.main_chart, alone(main_chart(bench.studies)))
    write_whole(left.page, page(bench))
    return left


def to_json(bench: Bench) -> str:
    """The bench as JSON; an infinite error is null. Maps have tables and pictures of their own."""
    studies = [
        {**asdict(study), "trials": [_plain(trial) for trial in study.trials]}
        for study in bench.studies
    ]
    whole = {
        "schema": SCHEMA,
        "effort": bench.effort,
        "seconds": round(bench.seconds, 1),
        "machine": dict(bench.machine),
        "peers": list(bench.peers),
        "studies": studies,
    }
    return json.dumps(whole, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def from_json(text: str) -> Bench:
    """A bench from its JSON. Raises `InputError` for another schema."""
    whole: dict[str, Any] = json.loads(text)
    if whole.get("schema") != SCHEMA:
        raise InputError(f"bench.json: schema {whole.get('schema')}; allowed: {SCHEMA}")
    studies = tuple(
        Study(**{**study, "trials": tuple(map(_trial, study["trials"]))})
        for study in whole["studies"]
    )
    return Bench(
        whole["effort"], whole["seconds"], whole["machine"], tuple(whole["peers"]), studies
    )


def _plain(trial: Trial) -> dict[str, object]:
    found = {name: getattr(trial, name) for name in _COLUMNS}
    for name in ("error", "error_median"):
        found[name] = found[name] if math.isfinite(found[name]) else None
    return found | {"more": dict(trial.more)}


def _trial(plain: dict[str, Any]) -> Trial:
    for name in ("error", "error_median"):
        plain = {**plain, name: math.inf if plain[name] is None else plain[name]}
    return Trial(**plain)


def table(study: Study) -> str:
    """A study as CSV: a row a trial, whether it is on its scene's front, and further figures."""
    more = sorted({name for trial in study.trials for name in trial.more})
    fronts = {(t.scene, t.label) for scene in study.scenes for t in pareto_front(study.of(scene))}
    rows = (
        [
            *(_cell(getattr(t, name)) for name in _COLUMNS),
            _cell((t.scene, t.label) in fronts),
            *(_cell(t.more.get(name, "")) for name in more),
        ]
        for t in study.trials
    )
    return _csv([*_COLUMNS, "on_front", *more], rows)


def map_table(picture: MapPicture) -> str:
    """The numbers behind a map as CSV."""
    rows = zip(*picture.columns.values(), strict=True)
    return _csv(list(picture.columns), ([_cell(value) for value in row] for row in rows))


def _csv(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
