"""Each kind of schema error in a protocol is explained with position, value and advice."""

import pytest

from tests.support.config.mistakes import PROTOCOL_MISTAKES
from tests.support.config.texts import PROTOCOL, changed, problems


@pytest.mark.parametrize("kind", PROTOCOL_MISTAKES)
def test_a_mistake_in_the_protocol(kind: str) -> None:
    old, new, message = PROTOCOL_MISTAKES[kind]
    assert problems(changed(PROTOCOL, old, new)) == (f"protocol.yaml:{message}",)
