"""Drafts of both kinds: texts of answers are loaded and planned as the files will be."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

from acquisition.drafts.interview import Draft
from acquisition.drafts.protocol_questions import Scan, protocol_questions
from acquisition.drafts.protocol_text import protocol_text
from acquisition.drafts.question import Answers
from acquisition.drafts.rig_questions import NONE, Bench, rig_questions
from acquisition.drafts.rig_text import rig_text
from acquisition.plan.plan import make_plan
from acquisition.results.model_check import check_model
from analysis.models import MODELS
from instrument.config.load import load_protocol, load_rig
from instrument.config.rig import Rig
from instrument.errors import InputError

_PLACE = re.compile(r":[0-9]+:[0-9]+: ")
_MODELS = ("lambert", "minnaert", "oren_nayar", "oren_nayar_exact", "oren_nayar+torrance_sparrow",
           "wolff", "ggx")  # fmt: skip


def rig_draft(bench: Bench, scratch: Path) -> Draft:
    """Return the draft of a rig file; `scratch`: folder for trials.

    Its mistakes are those of the file, and of a usual protocol for it.
    """
    path, protocol = scratch / "rig.yaml", scratch / "protocol.yaml"

    @lru_cache(maxsize=32)
    def found(text: str) -> tuple[str, ...]:
        path.write_text(text, encoding="utf-8")
        return _mistakes(lambda: _plan_usual(load_rig(path), path, protocol), path, protocol)

    return Draft(
        what="gonio new rig",
        script=lambda answers: rig_questions(bench, answers),
        text=lambda answers: rig_text(bench, answers),
        mistakes=lambda answers: found(rig_text(bench, _from_anywhere(bench, answers))),
    )


def _from_anywhere(bench: Bench, answers: Answers) -> Answers:
    """Return answers with the whole paths of calibrations, for a trial in another folder."""
    named = [key for key in ("calibration", "geometry") if answers[key] != NONE]
    folder = bench.folder.absolute()
    return {**answers, **{key: str(folder / str(answers[key])) for key in named}}


def _plan_usual(rig: Rig, rig_path: Path, protocol: Path) -> None:
    """Plan the protocol that `gonio new protocol` writes without questions."""
    scan = scan_of("usual", rig, rig_path, rig_path.parent)
    answers: Answers = {}
    for question in protocol_questions(scan, answers):
        answers[question.key] = question.default
    _plan(protocol_text(scan, answers), rig_path, protocol)


def _plan(text: str, rig_path: Path, protocol: Path) -> None:
    protocol.write_text(text, encoding="utf-8")
    make_plan(load_protocol(protocol, rig_path, check_model=check_model))


def scan_of(name: str, rig: Rig, rig_path: Path, folder: Path) -> Scan:
    """Return what a protocol in `folder` for this rig is asked about."""
    models = {m: {p.name: p.default for p in MODELS[m].parameters} for m in _MODELS}
    rig_name = os.path.relpath(rig_path, folder)
    return Scan(name=name, rig=rig, rig_path=rig_path, rig_name=rig_name, models=models)


def protocol_draft(scan: Scan, scratch: Path) -> Draft:
    """Return the draft of a protocol; `scratch`: folder for trials."""
    path = scratch / "protocol.yaml"

    @lru_cache(maxsize=32)
    def found(text: str) -> tuple[str, ...]:
        return _mistakes(lambda: _plan(text, scan.rig_path, path), path)

    return Draft(
        what="gonio new protocol",
        script=lambda answers: protocol_questions(scan, answers),
        text=lambda answers: protocol_text(scan, answers),
        mistakes=lambda answers: found(protocol_text(scan, answers)),
    )


def _mistakes(load: Callable[[], object], *paths: Path) -> tuple[str, ...]:
    """Return the mistakes of loading, without the places in the trial files `paths`."""
    try:
        load()
    except InputError as error:
        return tuple(_without_place(problem, paths) for problem in error.problems)
    return ()


def _without_place(problem: str, paths: tuple[Path, ...]) -> str:
    for path in paths:
        problem = re.sub(re.escape(str(path)) + _PLACE.pattern, "", problem)
        problem = problem.replace(str(path), "the new file")
    return problem
