"""What `gonio bench` makes of its trials: fronts, files, charts and page; and its command."""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.benchmark import command
from acquisition.benchmark.machine import machine
from acquisition.benchmark.number_text import percent, rounded, short
from acquisition.benchmark.output.charts import MAIN, alone, main_chart, study_chart
from acquisition.benchmark.output.files import from_json, table, to_json
from acquisition.benchmark.output.labels import Box, place, text_size
from acquisition.benchmark.output.page import page
from acquisition.benchmark.result import Bench
from acquisition.benchmark.study import Study
from acquisition.benchmark.timing import timed
from acquisition.benchmark.trial import Trial, pareto_front
from instrument.errors import InputError
from tests.support.command import gonio


def trial(study: str, scene: str, label: str, cost: float, error: float, **more: object) -> Trial:
    typical = error / 3 if math.isfinite(error) else error
    return Trial(study, scene, "kind", label, cost, error, typical, **more)  # type: ignore[arg-type]  # keywords of Trial


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
    title, caption = f"Title of {name}: why", "First line.\nSecond <line>."
    return Study(name, title, "time (ms)", "bias (relative)", caption, "a truth", tuple(trials))


@pytest.fixture(scope="module")
def bench() -> Bench:
    names = [name for name, _ in MAIN]
    peers = ("lmfit 1.0: the fit", "Mitsuba: not installed")
    return Bench("test", 12.0, machine(), peers, tuple(map(study, [*names, "bits"])))


@pytest.fixture(scope="module")
def text(bench: Bench) -> str:
    return page(bench)


@given(
    st.lists(
        st.tuples(st.floats(1e-3, 1e3), st.one_of(st.floats(0, 10), st.just(math.inf))), max_size=30
    )
)
def test_the_front_is_what_nothing_beats(points: list[tuple[float, float]]) -> None:
    trials = [trial("s", "x", str(n), *point) for n, point in enumerate(points)]
    front = pareto_front(trials)
    assert [t.cost for t in front] == sorted(t.cost for t in front)
    for t in front:
        assert math.isfinite(t.error)
        assert not any(o.cost <= t.cost and o.error < t.error for o in trials)
    for t in trials:
        beaten_or_on_it = any(f.cost <= t.cost and f.error <= t.error for f in front)
        assert beaten_or_on_it or not math.isfinite(t.error)


def test_a_limit_is_not_on_the_front() -> None:
    labels = [t.label for t in pareto_front(study("s").of("calm"))]
    assert labels == ["cheap", "usual", "flawless"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"cost": 0.0}, r"s, x, a: cost = 0; allowed: finite, more than 0"),
        ({"cost": math.inf}, "cost = inf"),
        ({"error": -1.0}, "error = -1; allowed: 0 or more"),
        ({"error_median": math.nan}, "error_median = nan"),
        ({"failures": 3, "attempts": 2}, "failures = 3; allowed: 0 to 2 attempts"),
    ],
)
def test_an_impossible_trial_is_refused(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        replace(trial("s", "x", "a", 1.0, 1.0), **change)


def test_a_study_has_its_own_trials_each_once() -> None:
    own = study("s")
    with pytest.raises(ValueError, match="two trials 'cheap' in 'calm'"):
        replace(own, trials=(*own.trials, own.trials[0]))
    with pytest.raises(ValueError, match="a trial of the study 's'"):
        replace(own, name="t")
    with pytest.raises(KeyError, match="no 'dear' in 'calm'; there are: cheap, usual"):
        own.named("calm", "dear")


def test_a_time_comes_with_what_was_timed() -> None:
    calls: list[str] = []

    def action() -> int:
        calls.append("timed")
        return sum(range(1000))

    found = timed(action, 3, lambda: calls.append("before"))
    assert found.value == 499_500
    assert 0 < found.least_s <= found.median_s
    assert found.spread >= 0
    assert calls == ["before", "timed"] * 4  # one of them not counted
    assert timed(action, 3).value == 499_500
    with pytest.raises(ValueError, match="repeats = 2; allowed: 3 or more"):
        timed(action, 2)


@settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(60, 340), st.floats(60, 240)), min_size=1, max_size=6))
def test_labels_keep_apart(marks: list[tuple[float, float]]) -> None:
    frame = Box(0, 0, 400, 300)
    texts = [f"method {n}" for n in range(len(marks))]
    boxes = [placed.box for placed in place(marks, texts, frame, 8.0)]
    width, height = text_size("method 0", 8.0)
    for n, box in enumerate(boxes):
        assert box.outside(frame) == pytest.approx(0, abs=1e-9)
        assert box.right - box.left == pytest.approx(width, rel=0.2)
        assert box.top - box.bottom == pytest.approx(height)
        assert sum(box.shared(other) for other in boxes[:n]) == 0


def test_numbers_as_a_reader_writes_them() -> None:
    assert [short(x) for x in (0, 0.02, 3.0, 1000, 1e4, 2e-4, 9.96e-7)] == [
        "0", "0.02", "3", "1000", "10⁴", "2·10⁻⁴", "10⁻⁶",
    ]  # fmt: skip
    assert [rounded(x) for x in (0.1234, 12.6, 1234.4)] == ["0.12", "13", "1234"]
    assert percent(0.0123) == "1.2 %"


def test_the_json_holds_all_but_the_maps(bench: Bench) -> None:
    text = to_json(bench)
    assert json.loads(text)["schema"] == 1
    assert from_json(text) == bench
    with pytest.raises(InputError, match=r"bench.json: schema 2; allowed: 1"):
        from_json(text.replace('"schema": 1', '"schema": 2'))


def test_a_table_has_a_row_a_trial(bench: Bench) -> None:
    rows = list(csv.DictReader(io.StringIO(table(bench.studies[0]))))
    assert len(rows) == len(bench.studies[0].trials)
    usual = next(row for row in rows if row["label"] == "usual")
    assert (usual["default"], usual["on_front"], usual["u_relative"]) == ("yes", "yes", "0.25")
    assert next(row for row in rows if row["label"] == "fails")["error"] == "inf"


def test_every_chart_says_what_its_axes_are(bench: Bench) -> None:
    one = bench.studies[-1]
    words = "".join(ElementTree.fromstring(alone(study_chart(one))).itertext())
    for expected in ("time (ms)", "bias (relative)", "usual (default)", "Pareto front"):
        assert expected in words
    assert all(scene in words for scene in one.scenes)
    words = "".join(ElementTree.fromstring(alone(main_chart(bench.studies))).itertext())
    assert words.count("time (ms)") == words.count("bias (relative)") == len(MAIN)


def test_the_page_is_whole_and_needs_nothing_else(bench: Bench, text: str) -> None:
    assert text.count("bias (relative)") == len(bench.studies) + len(MAIN)
    for one in bench.studies:
        assert f'id="{one.name}"' in text
    assert text.count("<svg") == len(bench.studies) + 1
    assert "First line.<br>Second &lt;line&gt;." in text
    assert "quick &amp; coarse" in text
    assert "no result" in text
    for line in (*bench.peers, *bench.machine.values()):
        assert line in text
    assert "http://" not in text.replace("http://www.w3.org", "")
    assert "https://" not in text


@dataclass(frozen=True)
class Picture:
    """A stand-in for a map."""

    title: str = "Where it fails"
    caption: str = "Read this.\nAnd this."
    svg: str = '<?xml version="1.0"?>\n<svg xmlns="http://www.w3.org/2000/svg"><g/></svg>'
    columns: dict[str, list[float | str]] = field(
        default_factory=lambda: {"theta_deg": [10.0, 20.0], "fails": ["no", "yes"]}
    )


def test_the_command_writes_all_of_it_with_maps(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Path] = []
    maps = ModuleType("maps_for_a_test")
    maps.draw_maps = lambda folder: asked.append(folder) or [Picture()]  # type: ignore[attr-defined]  # a module made up here
    monkeypatch.setitem(sys.modules, "maps_for_a_test", maps)
    monkeypatch.setattr(command, "MAPS", "maps_for_a_test")
    monkeypatch.setattr(
        "acquisition.benchmark.studies.all_studies.studies", lambda *_: iter(bench.studies)
    )
    folder = tmp_path / "bench"
    command.run_bench(folder, quick=True, with_maps=True)
    assert asked == [folder]
    assert {p.name for p in folder.iterdir()} == {
        "bench.html", "bench.json", "main_chart.svg", "map_1.csv",
        *(f"{one.name}.csv" for one in bench.studies),
    }  # fmt: skip
    assert (folder / "map_1.csv").read_text() == "theta_deg,fails\n10,no\n20,yes\n"
    written = (folder / "bench.html").read_text()
    assert "Where it fails" in written
    assert "<?xml" not in written
    assert from_json((folder / "bench.json").read_text()).effort == "quick"
    ElementTree.parse(folder / "main_chart.svg")


def test_maps_that_are_not_there_are_refused_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "MAPS", "acquisition.benchmark.no_such_maps")
    with pytest.raises(InputError, match=r"--maps: .* is not installed: leave --maps out"):
        command.run_bench(tmp_path / "bench", quick=True, with_maps=True)
    assert not (tmp_path / "bench").exists()


def test_a_folder_that_is_not_empty_is_refused(tmp_path: Path) -> None:
    (tmp_path / "kept.txt").write_text("mine")
    for wrong in (tmp_path, tmp_path / "kept.txt"):
        done = gonio("bench", "--quick", "--out", wrong)
        assert done.returncode == 2
        assert f"{wrong}: --out must be absent or an empty folder" in done.stderr
    assert {p.name for p in tmp_path.iterdir()} == {"kept.txt"}


def test_the_folder_has_to_be_named() -> None:
    done = gonio("bench")
    assert done.returncode == 2
    assert "--out" in done.stderr
