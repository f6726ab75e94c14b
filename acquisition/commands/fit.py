"""Command `gonio fit`: read a source, choose a model, print the outcome."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rich import box
from rich.table import Table

from acquisition.commands.fit_status import no_fit_reported, print_json, require_result
from acquisition.results.model_check import check_model
from acquisition.results.sources import Source, Wanted, read_source
from acquisition.results.summary import VERDICTS, paper_ratio_note, parameters_of, value_text
from acquisition.terminal.console import out
from analysis.choice.choice import Choice, choose
from analysis.choice.fit_json import to_json
from analysis.choice.ladder import METHODS, MethodOfFit
from analysis.fit.fit import FitResult
from instrument.errors import InputError
from instrument.text.quoting import printable
from instrument.text.text_file import parse_number

_MOST_ROWS = 12  # of the table of candidates


def fit_source(
    path: Path, wanted: Wanted, *, models: str | None, robust: bool, method: str, as_json: bool
) -> None:
    """Fit the `wanted` part of a source and print the outcome.

    `models`: names separated by commas; None for those of a run's protocol, else the ladder.
    `method`: for rough surfaces, one of `analysis.choice.ladder.METHODS`; auto: that of a run's
    protocol. Raises `InputError` for a wrong source or option; after printing, as
    `fit_status.require_result` does.
    """
    names, way = _names(models), _method(method, models)
    with no_fit_reported(path, as_json):
        source = read_source(path, wanted)
        if names is None and way == "auto":
            names, way = source.fit.models, source.fit.method
        choice = choose(source.measurements, source.acceptance, names, robust, way)
    found = to_json(replace(choice, notes=(*source.notes, *choice.notes)))
    if as_json:
        print_json(found)
    else:
        _print(source, choice)
    require_result(found, str(path))


def _names(models: str | None) -> list[str] | None:
    """Names of models separated by commas; None for those of the ladder."""
    if models is None:
        return None
    names = [name.strip() for name in models.split(",")]
    wrong = [words for words in (check_model(name, None) for name in names) if words]
    if wrong:
        raise InputError(*(f"--models: {words}" for words in wrong))
    if len(set(names)) < len(names):
        raise InputError(f"--models: {models}: a model is named twice; name each once")
    return names


def _method(method: str, models: str | None) -> MethodOfFit:
    """Method for rough surfaces; only `auto` goes with --models, whose names imply the method."""
    for known in METHODS:
        if method == known:
            if models is not None and known != "auto":
                raise InputError(
                    f"--method: {method}; allowed: auto, as the names in --models imply the method"
                )
            return known
    raise InputError(f"--method: {method}; allowed: {', '.join(METHODS)}")


def parse_u_shared(text: str | None) -> float | None:
    """Relative u of an error that all values share: `0.5%`, or 0.005 as a plain number."""
    if text is None:
        return None
    allowed = "allowed: more than 0 and less than 50 %, as 0.5% or 0.005"
    number, percent = text.strip().removesuffix("%"), text.strip().endswith("%")
    try:
        u = parse_number(number) / (100 if percent else 1)
    except ValueError as error:
        raise InputError(f"--u-shared: {error}; {allowed}") from None
    if not 0 < u < 0.5:
        raise InputError(f"--u-shared: {printable(text)}; {allowed}")
    return u


def _print(source: Source, choice: Choice) -> None:
    chosen = choice.best
    if chosen is None:
        out.print(f"{choice.verdict}: {choice.reason}", highlight=False)
        return
    out.print(f"{chosen.model}: {VERDICTS[choice.verdict]}.", highlight=False)
    parameters = Table("parameter", "value ± u (k = 1)")
    for parameter in parameters_of(chosen):
        parameters.add_row(parameter.name, value_text(parameter))
    out.print(parameters)
    out.print(_table(choice, chosen))
    noted = (note.text for note in (*source.notes, *choice.notes))
    for text in (choice.reason, str(choice.symmetry), paper_ratio_note(chosen), *noted):
        if text:
            out.print(f"- {text}", highlight=False)


def _table(choice: Choice, chosen: FitResult) -> Table:
    """The candidates of lowest BIC, and the chosen one; K is the number of parameters."""
    best_bic = min(c.bic for c in choice.candidates)
    best_aicc = min(c.aicc for c in choice.candidates)
    ordered = sorted(choice.candidates, key=lambda c: c.bic)
    shown = [c for n, c in enumerate(ordered) if n < _MOST_ROWS or c is chosen]
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), caption_justify="left")
    table.caption = "→ chosen, ✗ does not fit"
    if len(shown) < len(ordered):
        table.caption += f"; {len(ordered) - len(shown)} more candidates: see --json"
    table.add_column("\u00a0\u00a0candidate", overflow="fold")  # wraps in a narrow terminal
    for name in ("K", "rms/mean", "χ²/dof", "ΔBIC", "ΔAICc"):
        table.add_column(name, no_wrap=True)
    for c in shown:
        chi2 = "" if c.reduced_chi2 is None else _short(c.reduced_chi2)
        mark = "→" if c is chosen else "" if c.model in choice.agreeing else "✗"
        row = (f"{100 * c.rms_relative:.3g} %", chi2, _short(c.bic - best_bic))
        table.add_row(
            f"{mark:\u00a0<1}\u00a0{c.model}", str(c.x.size), *row, _short(c.aicc - best_aicc)
        )
    return table


def _short(number: float) -> str:
    """Return the number in at most six characters."""
    if abs(number) < 10:
        return f"{number:.2f}"
    return f"{number:.0f}" if number < 1e6 else f"{number:.0e}"
