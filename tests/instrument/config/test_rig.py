"""Each kind of mistake in a rig file is reported with its position, value and what is allowed."""

from pathlib import Path

import pytest

from instrument.config.load import load_rig
from instrument.errors import InputError
from tests.support.config.mistakes import RIG_MISTAKES
from tests.support.config.texts import RIG, changed, problems


@pytest.mark.parametrize("kind", RIG_MISTAKES)
def test_a_mistake_in_the_rig(kind: str) -> None:
    old, new, message = RIG_MISTAKES[kind]
    rig = changed(RIG, old, new)
    assert problems(rig=rig) == (f"rig.yaml:{message}",)
    with pytest.raises(InputError) as caught:
        load_rig(Path("rig.yaml"))
    assert caught.value.problems == (f"rig.yaml:{message}",)
