"""Labels: they stay in the frame and do not overlap."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.benchmark.output.labels import Box, place, text_size


@settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(60, 340), st.floats(60, 240)), min_size=1, max_size=6))
def test_labels_do_not_overlap(marks: list[tuple[float, float]]) -> None:
    frame = Box(0, 0, 400, 300)
    texts = [f"method {n}" for n in range(len(marks))]
    boxes = [placed.box for placed in place(marks, texts, frame, 8.0)]
    width, height = text_size("method 0", 8.0)
    for n, box in enumerate(boxes):
        assert box.outside(frame) == pytest.approx(0, abs=1e-9)
        assert box.right - box.left == pytest.approx(width, rel=0.2)
        assert box.top - box.bottom == pytest.approx(height)
        assert sum(box.shared(other) for other in boxes[:n]) == 0
