"""Values of a protocol that contradict one another or its rig are reported with their position."""

import pytest

from tests.support.config.mistakes import CHECK_MISTAKES
from tests.support.config.texts import PROTOCOL, changed, load, problems


@pytest.mark.parametrize("kind", CHECK_MISTAKES)
def test_a_contradiction_in_the_protocol(kind: str) -> None:
    old, new, message = CHECK_MISTAKES[kind]
    assert problems(changed(PROTOCOL, old, new)) == (f"protocol.yaml:{message}",)


def test_a_marker_must_lie_beside_the_sample() -> None:
    """The sample reaches to 25 mm; a marker of 6 mm to 3 mm around its middle."""
    lines = "markers: {{size_mm: 6.0, centres_mm: [[-28.5, 0.0], [{}, 10.0]]}}\n"
    load(protocol=PROTOCOL + lines.format(29.0))
    (covered,) = problems(protocol=PROTOCOL + lines.format(27.0))
    assert "markers.centres_mm[1]: marker 1 at x 27, y 10 mm is covered by the sample" in covered
    assert "beside it, x or y 28 or 28 mm or more from its middle" in covered
