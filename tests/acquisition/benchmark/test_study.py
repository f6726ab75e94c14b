"""Studies: each has its own trials, each once."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.support.benchmark import study


def test_a_study_has_its_own_trials_each_once() -> None:
    own = study("s")
    with pytest.raises(ValueError, match="two trials 'cheap' in 'calm'"):
        replace(own, trials=(*own.trials, own.trials[0]))
    with pytest.raises(ValueError, match="a trial of the study 's'"):
        replace(own, name="t")
