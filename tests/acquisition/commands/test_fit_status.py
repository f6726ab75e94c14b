"""Exit codes of the verdicts: `run`, `resume`, `report` and `fit` agree; every file is there."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import pytest

from acquisition.commands.fit_status import require_result
from instrument.errors import AllFlagged, NotDetermined
from tests.support.command import gonio_here as gonio
from tests.support.scans import TWO_MODELS, small_demo

FILES = {"record.sqlite", "measurements.csv", "fit.json", "report.html"}
COMPLETE = "the run is complete: all readings are recorded and reported"


class Case(NamedTuple):
    """Changes of the protocol's text, and what a fit of its run ends with.

    models: the candidates; empty for the automatic choice.
    """

    changes: Mapping[str, str]
    code: int
    verdict: str | None
    words: str = ""
    models: str = ""


WITH_TILE = "  white_tile: {reflectance: 0.99, u_reflectance: 0.005, theta_r_deg: 10.0}\n"
DRIFT_CHECK = "  drift_check: {theta_r_deg: 10.0, every_points: 25}\n"
CASES = {
    "adequate": Case({}, 0, "adequate", models=TWO_MODELS),
    "no candidate is adequate": Case({}, 0, "none adequate", models="lambert"),
    "no white tile": Case(
        {WITH_TILE: ""},
        5,
        "not identifiable",
        "do not determine albedo",
        TWO_MODELS,
    ),
    "too few points": Case(
        {
            "[30.0, 60.0]": "[30.0]",
            "{start: -80.0, stop: 80.0, num: 9}": "[0.0]",
        },
        5,
        "not identifiable",
        "1 point is too few",
        "oren_nayar",
    ),
    "black sample, no later reading that proves that the lamp was on": Case(
        {"albedo: 0.80": "albedo: 0.0", "ks: 0.076": "ks: 0.0", DRIFT_CHECK: ""},
        3,
        None,
        "no measurement: all 17 points are flagged (no signal)",
    ),
    "every point flagged": Case(
        {"width_mm: 20.0, height_mm: 20.0": "width_mm: 0.3, height_mm: 0.3"},
        3,
        None,
        "no measurement: all 17 points are flagged (too few pixels, white tile too few pixels)",
    ),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_four_commands_end_with_the_same_code_and_verdict(case: Case, tmp_path: Path) -> None:
    protocol, run = small_demo(tmp_path), tmp_path / "run"
    text = protocol.read_text()
    for old, new in case.changes.items():
        assert old in text
        text = text.replace(old, new)
    protocol.write_text(text + (f"fit: {{models: [{case.models}]}}\n" if case.models else ""))
    commands = (
        ("run", protocol, "--out", run),
        ("resume", run),
        ("report", run),
        ("fit", run, *(("--models", case.models) if case.models else ())),
    )
    for command in commands:
        done = gonio(*command, "--json")
        assert done.returncode == case.code, (command, done.stderr)
        assert json.loads(done.stdout)["verdict"] == case.verdict, command
        assert case.words in done.stderr, command
        if case.code and command[0] != "fit":
            assert f"{run}: {COMPLETE}" in done.stderr
        assert {path.name for path in run.iterdir()} >= FILES
        assert json.loads((run / "fit.json").read_text())["verdict"] == case.verdict
        if case.verdict is None:
            assert f"No model was fitted: {case.words}" in (run / "report.html").read_text()


@pytest.mark.parametrize(
    ("verdict", "chosen", "error"),
    [
        ("adequate", "lambert", None),
        ("none adequate", "lambert", None),
        ("none adequate", None, NotDetermined),  # nothing converged
        ("not identifiable", "oren_nayar", NotDetermined),
        ("not identifiable", None, NotDetermined),
        (None, None, AllFlagged),
    ],
)
def test_every_verdict_has_its_error(
    verdict: str | None, chosen: str | None, error: type[NotDetermined] | None
) -> None:
    fit = {"verdict": verdict, "chosen": chosen, "reason": "because"}
    if error is None:
        require_result(fit, "run")
        return
    with pytest.raises(NotDetermined, match=r"^run: because$") as raised:
        require_result(fit, "run")
    assert type(raised.value) is error
