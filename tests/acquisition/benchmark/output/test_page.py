"""Page of a benchmark: complete and self-contained."""

from __future__ import annotations

from acquisition.benchmark.output.charts import MAIN
from acquisition.benchmark.output.page import page
from tests.support.benchmark import result


def test_the_page_is_complete_and_self_contained() -> None:
    benchmark = result()
    text = page(benchmark)
    assert text.count("bias (relative)") == len(benchmark.studies) + len(MAIN)
    for one in benchmark.studies:
        assert f'id="{one.name}"' in text
    assert text.count("<svg") == len(benchmark.studies) + 1
    assert "First line.<br>Second &lt;line&gt;." in text
    assert "quick &amp; coarse" in text
    assert "no result" in text
    for line in (*benchmark.peers, *benchmark.machine.values()):
        assert line in text
    assert "http://" not in text.replace("http://www.w3.org", "")
    assert "https://" not in text
