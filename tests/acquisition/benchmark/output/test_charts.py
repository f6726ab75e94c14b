"""Charts: axes, scenes, default and front are labelled."""

from __future__ import annotations

from xml.etree import ElementTree

from acquisition.benchmark.output.charts import MAIN, main_chart, standalone, study_chart
from tests.support.benchmark import result


def words_in(svg: str) -> str:
    return "".join(ElementTree.fromstring(standalone(svg)).itertext())


def test_every_chart_labels_its_axes() -> None:
    studies = result().studies
    words = words_in(study_chart(studies[-1]))
    for expected in ("time (ms)", "bias (relative)", "usual (default)", "Pareto front"):
        assert expected in words
    assert all(scene in words for scene in studies[-1].scenes)
    words = words_in(main_chart(studies))
    assert words.count("time (ms)") == words.count("bias (relative)") == len(MAIN)
