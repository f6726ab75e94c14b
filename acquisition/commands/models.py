"""Command `gonio models`: the reflectance models, their parameters, and the candidates of a fit."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence

from acquisition.results.model_check import check_model
from acquisition.terminal.console import out, print_lines, print_text
from acquisition.terminal.layout import text_table_lines
from analysis.choice.ladder import CANDIDATES
from analysis.models import MODELS, Parameter
from instrument.errors import InputError


def list_models(names: Sequence[str], as_json: bool) -> None:
    """Print models with the domain and the default of each parameter; all single ones by default.

    Raises `InputError` for an unknown name.
    """
    wrong = [words for words in (check_model(name, None) for name in names) if words]
    if wrong:
        raise InputError(*(f"gonio models: {words}" for words in wrong))
    if as_json:
        sys.stdout.write(json.dumps(_json(names or list(MODELS))) + "\n")
        return
    rows = [
        (name, ", ".join(map(_domain, MODELS[name].parameters))) for name in names or list(MODELS)
    ]
    print_lines(text_table_lines(rows, out.width))
    if not names:
        print_text("")
        print_text(
            f"A sum is written with +; a parameter that its parts share is one parameter of the "
            f"sum. Candidates of a fit by default: {', '.join(CANDIDATES)}."
        )


def completed_names(incomplete: str) -> list[str]:
    """Return the ways to complete a text that ends with a name: after a comma, or alone."""
    before, comma, beginning = incomplete.rpartition(",")
    known = dict.fromkeys((*MODELS, *CANDIDATES))
    return [before + comma + name for name in known if name.startswith(beginning)]


def _domain(parameter: Parameter) -> str:
    return f"{parameter.name} {parameter.domain} (default {parameter.default:g})"


def _json(names: Sequence[str]) -> dict[str, object]:
    parameters = {
        name: {
            p.name: {"unit": p.unit, "low": p.low, "high": p.high, "default": p.default}
            for p in MODELS[name].parameters
        }
        for name in names
    }
    return {"models": parameters, "candidates": list(CANDIDATES)}
