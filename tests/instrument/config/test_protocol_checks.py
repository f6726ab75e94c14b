"""Values of a protocol that contradict one another or its rig are reported with their position."""

import pytest

from tests.support.config.mistakes import CHECK_MISTAKES
from tests.support.config.texts import PROTOCOL, changed, problems


@pytest.mark.parametrize("kind", CHECK_MISTAKES)
def test_a_contradiction_in_the_protocol(kind: str) -> None:
    old, new, message = CHECK_MISTAKES[kind]
    assert problems(changed(PROTOCOL, old, new)) == (f"protocol.yaml:{message}",)
