"""Made-up trials, studies and a result of a benchmark, and the effort of a short real one."""

from __future__ import annotations

import json
import math
import re
from typing import Any
from xml.etree import ElementTree

from acquisition.benchmark.effort import Effort
from acquisition.benchmark.output.charts import MAIN
from acquisition.benchmark.result import BenchmarkResult, MapPicture
from acquisition.benchmark.study import Study
from acquisition.benchmark.trial import Trial, select

FEW = Effort(
    name="test", truths=2, batch=512, repeats=3, frame_views=3, starts=4, data_sets=1, seeds=2,
    draws=20, thorough=False,
)  # fmt: skip


def trial(study: str, scene: str, label: str, cost: float, error: float, **more: object) -> Trial:
    """A trial whose median error is a third of its error."""
    typical = error / 3 if math.isfinite(error) else error
    return Trial(
        study=study, scene=scene, series="kind", label=label, cost=cost, error=error,
        error_median=typical,
        **more,  # type: ignore[arg-type]  # keywords of Trial
    )  # fmt: skip


def study(name: str) -> Study:
    """Two scenes; a default, a peer, a limit, a method without a result and one without error."""
    trials = []
    for scene in ("calm", "rough <&>"):
        trials += [
            trial(name, scene, "cheap", 1.0, 0.5, note="quick & coarse"),
            trial(name, scene, "usual", 10.0, 1e-3, default=True, more={"u_relative": 0.25}),
            trial(name, scene, "theirs", 12.0, 2e-3, peer=True, failures=1, attempts=4),
            trial(name, scene, "fails", 20.0, math.inf),
            trial(name, scene, "flawless", 500.0, 0.0),
            trial(name, scene, "limit", 10.0, 1e-4, bound=True),
        ]
    return Study(
        name=name,
        title=f"Title of {name}: why",
        cost_axis="time (ms)",
        error_axis="bias (relative)",
        caption="First line.\nSecond <line>.",
        truth="a truth",
        trials=tuple(trials),
    )


def result() -> BenchmarkResult:
    """The studies of the main chart and one more."""
    return BenchmarkResult(
        effort="test",
        seconds=12.0,
        machine={"processor": "a processor", "cores": "2", "Python": "3.11.0", "date": "today"},
        peers=("lmfit 1.0: the fit", "Mitsuba: not installed"),
        studies=tuple(map(study, [*(name for name, _ in MAIN), "bits"])),
    )


def trial_of(study: Study, scene: str, label: str) -> Trial:
    """The trial of a method in a scene."""
    (found,) = select(study.in_scene(scene), label=label)
    return found


def worst(study: Study, label: str) -> float:
    """The largest error of a method over all scenes."""
    return max(trial_of(study, scene, label).error for scene in study.scenes)


def check_complete(picture: MapPicture) -> None:
    """Fail unless a map is a picture with its numbers, readable in grey."""
    page = ElementTree.fromstring(picture.svg)  # our own text
    words = " ".join("".join(e.itertext()) for e in page.iter() if e.tag.endswith("text"))
    assert "°" in words or "g" in words
    assert "$" not in words  # no markup is left in a label
    assert picture.caption
    sizes = {len(values) for values in picture.columns.values()}
    assert len(sizes) == 1
    assert sizes.pop() > 100
    if "window" not in picture.title:  # its lines have markers and dashes of their own
        # Without colours: every fill and stroke is a grey.
        for colour in set(re.findall(r"#([0-9a-fA-F]{6})", picture.svg)):
            assert colour[:2].lower() == colour[2:4].lower() == colour[4:].lower()


def from_json(text: str) -> BenchmarkResult:
    """The result in a bench.json, without maps."""
    whole: dict[str, Any] = json.loads(text)
    studies = tuple(
        Study(**{**study, "trials": tuple(map(_trial, study["trials"]))})
        for study in whole["studies"]
    )
    others = {name: whole[name] for name in ("effort", "seconds", "machine")}
    return BenchmarkResult(**others, peers=tuple(whole["peers"]), studies=studies)


def _trial(plain: dict[str, Any]) -> Trial:
    errors = {n: math.inf if plain[n] is None else plain[n] for n in ("error", "error_median")}
    return Trial(**{**plain, **errors})
