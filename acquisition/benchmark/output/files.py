"""Files of a benchmark: bench.json, a CSV table per study and map, the page, the main chart."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, fields
from pathlib import Path

from acquisition.benchmark.output.charts import main_chart, standalone
from acquisition.benchmark.output.page import page
from acquisition.benchmark.result import BenchmarkResult, MapPicture
from acquisition.benchmark.study import Study
from acquisition.benchmark.trial import Trial, pareto_front
from instrument.errors import InputError
from instrument.text.atomic_file import write_whole

SCHEMA = 1
"""Of bench.json; increased when a field is renamed or changes its meaning."""

_COLUMNS = tuple(f.name for f in fields(Trial) if f.name != "more")
_ERRORS = ("error", "error_median")


def empty_folder(folder: Path) -> None:
    """Make the folder. Raises `InputError` if it exists and is not empty."""
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(f"{folder}: --out must be absent or an empty folder: name another")
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot write the benchmark there: {error}") from error


def write(result: BenchmarkResult, folder: Path) -> Path:
    """Write all files into an existing folder; return the path of the page."""
    texts = {"bench.json": to_json(result)}
    texts |= {f"{study.name}.csv": table(study) for study in result.studies}
    texts |= {f"map_{n}.csv": map_table(m) for n, m in enumerate(result.maps, start=1)}
    texts["main_chart.svg"] = standalone(main_chart(result.studies))
    texts["bench.html"] = page(result)  # last: a page means that the rest is there
    for name, text in texts.items():
        write_whole(folder / name, text)
    return folder / "bench.html"


def to_json(result: BenchmarkResult) -> str:
    """Return the studies as JSON, an infinite error as null. Maps are not in it."""
    studies = [
        {**asdict(study), "trials": [_plain(trial) for trial in study.trials]}
        for study in result.studies
    ]
    whole = {
        "schema": SCHEMA,
        "effort": result.effort,
        "seconds": round(result.seconds, 1),
        "machine": dict(result.machine),
        "peers": list(result.peers),
        "studies": studies,
    }
    return json.dumps(whole, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def _plain(trial: Trial) -> dict[str, object]:
    found = {name: getattr(trial, name) for name in _COLUMNS}
    finite = {name: found[name] if math.isfinite(found[name]) else None for name in _ERRORS}
    return {**found, **finite, "more": dict(trial.more)}


def table(study: Study) -> str:
    """Return a study as CSV: one row per trial, with its place on the front and more figures."""
    more = sorted({name for trial in study.trials for name in trial.more})
    fronts = {
        (t.scene, t.label) for scene in study.scenes for t in pareto_front(study.in_scene(scene))
    }
    rows = (
        [
            *(getattr(t, name) for name in _COLUMNS),
            (t.scene, t.label) in fronts,
            *(t.more.get(name, "") for name in more),
        ]
        for t in study.trials
    )
    return _csv([*_COLUMNS, "on_front", *more], rows)


def map_table(picture: MapPicture) -> str:
    """Return the numbers of a map as CSV."""
    return _csv(list(picture.columns), zip(*picture.columns.values(), strict=True))


def _csv(header: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return text.getvalue()


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
