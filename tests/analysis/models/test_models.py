"""The mapping of models by name."""

from __future__ import annotations

import pytest

from analysis.models import MODELS


@pytest.mark.parametrize("name", ["phong", "lambert+phong", "lambert+lambert", ""])
def test_unknown_names_list_the_known(name: str) -> None:
    with pytest.raises(KeyError, match=r"oren_nayar_qualitative|each model once in a sum"):
        MODELS[name]
    assert name not in MODELS


def test_the_mapping_lists_the_single_models() -> None:
    assert {"lambert", "oren_nayar", "oren_nayar_qualitative", "torrance_sparrow"} <= set(MODELS)
    assert all(MODELS[name].name == name for name in MODELS)
    assert len(MODELS) == len(list(MODELS))
