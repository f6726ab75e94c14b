"""Page of a run that has ended, for tests that only ask."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.live.pages import served
from tests.support.live.runs import live_protocol, whole_run


@pytest.fixture(scope="package")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Its address."""
    folder = tmp_path_factory.mktemp("ended")
    with served(whole_run(live_protocol(folder), folder / "run")) as address:
        yield address
