"""The check of a protocol's models."""

from __future__ import annotations

import pytest

from acquisition.results.model_check import check_model


def test_a_known_model_with_its_parameters_is_right() -> None:
    assert check_model("oren_nayar", {"albedo": 0.8, "sigma_deg": 30.0}) is None
    assert check_model("oren_nayar+torrance_sparrow", None) is None


@pytest.mark.parametrize(
    ("name", "parameters", "words"),
    [
        ("phong", None, "unknown model 'phong'"),
        ("lambert", {"albedo": 1.5}, "albedo"),
        ("lambert", {"albedo": 0.5, "sigma_deg": 3.0}, "sigma_deg"),
        ("lambert", {}, "albedo"),
    ],
)
def test_a_mistake_is_named(name: str, parameters: dict[str, float] | None, words: str) -> None:
    assert words in (check_model(name, parameters) or "")
