"""Content of fit.json: the agreed keys, and plain values."""

from __future__ import annotations

import json

from analysis.choice.choice import choose
from analysis.choice.fit_json import to_json
from analysis.choice.ladder import CANDIDATES
from tests.support.analysis.seeded_scan import scan


def test_the_keys_are_as_documented() -> None:
    found = choose(scan("lambert", 1, albedo=0.8))
    written = to_json(found)
    assert json.loads(json.dumps(written, allow_nan=False)) == written
    assert list(written) == [
        "chosen", "verdict", "reason", "notes", "symmetry", "shared_errors", "candidates",
    ]  # fmt: skip
    assert written["symmetry"]["says"] == "smooth"
    assert {c["model"] for c in written["candidates"]} <= set(CANDIDATES)
    for candidate in written["candidates"]:
        assert list(candidate) == [
            "model", "parameters", "rms_relative", "reduced_chi2", "bic", "aicc", "converged",
            "agrees", "message", "ratios",
        ]  # fmt: skip
        for entry in candidate["parameters"].values():
            interval = {"interval"} if entry["u"] is None else set()
            assert set(entry) == {"value", "u"} | interval


def test_ratios_of_scales_have_a_value_and_u() -> None:
    name = "lambert+torrance_sparrow"
    truth = {"albedo": 0.5, "ks": 0.1, "sigma_deg": 20.0}
    (candidate,) = to_json(choose(scan(name, 1, **truth), models=[name]))["candidates"]
    assert list(candidate["ratios"]) == ["ks/albedo"]
    ratio = candidate["ratios"]["ks/albedo"]
    assert list(ratio) == ["value", "u"]
    assert abs(ratio["value"] - 0.2) < 4 * ratio["u"]
