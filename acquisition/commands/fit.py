"""Command `gonio fit`: read a source, choose a model, print the outcome, write a report of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path

from acquisition.commands.fit_status import no_fit_reported, print_json, require_result
from acquisition.commands.outcomes.new_folder import require_new_folder, write_files
from acquisition.commands.outcomes.relative_u import parse_relative_u
from acquisition.commands.views import parameter_lines
from acquisition.results.model_check import check_model
from acquisition.results.sources import Source, Wanted, read_source, require_wanted
from acquisition.results.summary import paper_ratio_note, parameters_of, verdict_sentence
from acquisition.terminal.console import console, out, print_lines, print_notes, print_text
from acquisition.terminal.layout import table_lines, wrapped
from acquisition.terminal.progress import sign_of_life
from analysis.choice.choice import Choice, choose
from analysis.choice.fit_json import no_fit_json, to_json
from analysis.choice.ladder import METHODS, MethodOfFit, method_named
from analysis.fit.fit import FitResult
from analysis.models.smooth.fresnel_lobe import out_of_plane
from instrument.config.protocol_checks import through_polariser
from instrument.errors import InputError, NotDetermined

_MOST_ROWS = 12  # of the table of candidates

SignOfLife = Callable[[str], AbstractContextManager[None]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """Request for a fit, as the options of the command have it.

    wanted: part of the source. models: names separated by commas; None for those of a run's
    protocol, else the ladder. method: for rough surfaces, one of `analysis.choice.ladder.METHODS`;
    auto: that of a run's protocol.
    """

    wanted: Wanted
    models: str | None = None
    robust: bool = False
    method: str = "auto"


@dataclass(frozen=True, slots=True)
class Fitted:
    """Fit of a source, with the content of fit.json; without a choice, `error` says why."""

    source: Source
    choice: Choice | None
    json: Mapping[str, object]
    error: NotDetermined | None = None


def require_options(asked: Asked) -> None:
    """Raise `InputError` for an option that is wrong for every source."""
    require_wanted(asked.wanted)
    _names(asked.models)
    _method(asked.method, asked.models)


def fit_source(path: Path, asked: Asked, *, folder: Path | None = None, as_json: bool) -> None:
    """Fit what is asked for of a source and print the outcome.

    `folder`: a new one for report.html and fit.json, also where no model could be fitted. Raises
    `InputError` for a wrong source or option; after printing, as `fit_status.require_result` does.
    """
    require_options(asked)
    if folder is not None:
        require_new_folder(folder, "--out")
    with no_fit_reported(path, as_json):
        fitted = fit_of(path, asked, sign_of_life)
        if fitted.error is not None:
            if folder is not None:
                _write(folder, path, fitted)
            raise fitted.error
    if as_json:
        print_json(fitted.json)
    elif fitted.choice is not None:
        _print(fitted.source, fitted.choice)
    if folder is not None:
        _write(folder, path, fitted)
    require_result(fitted.json, str(path))


def fit_of(path: Path, asked: Asked, sign: SignOfLife) -> Fitted:
    """Read a source and choose its model; `sign` shows that either is under way.

    Raises `InputError` for a wrong source or option, and as `read_source` does where there is
    nothing to fit.
    """
    names, way = _names(asked.models), _method(asked.method, asked.models)
    with sign(f"reading {path.name}"):
        source = read_source(path, asked.wanted)
    if names is None and way == "auto":
        names, way = source.fit.models, source.fit.method
    names = _seen(names, source)
    try:
        with sign(f"fit of {source.measurements.size} points"):
            choice = _choice(source, names, asked.robust, way)
    except NotDetermined as error:
        return Fitted(source, None, no_fit_json(error), error)
    return Fitted(source, choice, to_json(replace(choice, notes=(*source.notes, *choice.notes))))


def report_files(path: Path, fitted: Fitted) -> dict[str, str]:
    """Content of report.html, fit.json and measurements.csv, by name."""
    from acquisition.commands.outcomes.fit_report import fit_files  # heavy: the charts' library

    source, choice = fitted.source, fitted.choice
    return fit_files(path, source, choice, fitted.json, _remarks(source, choice))


def _seen(names: Sequence[str] | None, source: Source) -> list[str] | None:
    """Names of the models as a run's polariser shows them.

    Raises `InputError` where a polariser's angle has no meaning at the source's geometries.
    """
    angle_deg = source.polariser_deg
    if names is None or angle_deg is None:
        seen = None if names is None else list(names)
    else:
        seen = [through_polariser(name, angle_deg) for name in names]
    text = out_of_plane(seen or (), source.measurements.geometry)
    if text is not None:
        raise InputError(text)
    return seen


def _choice(
    source: Source, names: Sequence[str] | None, robust: bool, method: MethodOfFit
) -> Choice:
    return choose(
        source.measurements,
        source.acceptance,
        names,
        robust,
        method,
        certificate_leads=source.fit.certificate_leads,
    )


def _write(folder: Path, path: Path, fitted: Fitted) -> None:
    """Write the files of the fit, and say where the report is."""
    with sign_of_life("report"):
        write_files(folder, report_files(path, fitted))
    console.print(f"report: {folder / 'report.html'}", highlight=False, soft_wrap=True)


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
    known = method_named(method)
    if known is None:
        raise InputError(f"--method: {method}; allowed: {', '.join(METHODS)}")
    if models is not None and known != "auto":
        raise InputError(
            f"--method: {method}; allowed: auto, as the names in --models imply the method"
        )
    return known


def parse_u_shared(text: str | None) -> float | None:
    """Relative u of an error that all values share: `0.5%`, or 0.005 as a plain number."""
    return None if text is None else parse_relative_u(text, "--u-shared")


def _print(source: Source, choice: Choice) -> None:
    chosen = choice.best
    if chosen is None:
        print_text(f"{choice.verdict}: {choice.reason}")
        return
    print_text(verdict_sentence(choice, choice.reason))
    print_lines(["", *parameter_lines(parameters_of(chosen), out.width), ""])
    print_lines([*_table(choice, chosen, out.width), ""])
    print_notes(_remarks(source, choice))


def _remarks(source: Source, choice: Choice | None) -> list[str]:
    """Remarks on the data and the fit, as the terminal and the report have them."""
    noted = [note.text for note in (*source.notes, *(choice.notes if choice else ()))]
    if choice is None or choice.best is None:
        return noted
    remarks = (choice.reason, str(choice.symmetry), paper_ratio_note(choice.best), *noted)
    return [remark for remark in remarks if remark]


def _table(choice: Choice, chosen: FitResult, width: int) -> list[str]:
    """The candidates of lowest BIC, and the chosen one; K is the number of parameters."""
    best_bic = min(c.bic for c in choice.candidates)
    best_aicc = min(c.aicc for c in choice.candidates)
    ordered = sorted(choice.candidates, key=lambda c: c.bic)
    shown = [c for n, c in enumerate(ordered) if n < _MOST_ROWS or c is chosen]
    rows = []
    for c in shown:
        mark = "→" if c is chosen else "" if c.model in choice.agreeing else "✗"
        chi2 = "" if c.reduced_chi2 is None else _short(c.reduced_chi2)
        above = _short(c.bic - best_bic), _short(c.aicc - best_aicc)
        rms = f"{100 * c.rms_relative:.3g} %"
        rows.append((f"{mark:1} {c.model}", str(c.x.size), rms, chi2, *above))
    header = ("  candidate", "K", "rms/mean", "χ²/dof", "ΔBIC", "ΔAICc")
    caption = "→ chosen, ✗ does not fit; K: number of parameters; Δ: above the lowest"
    if len(shown) < len(ordered):
        caption += f"; {len(ordered) - len(shown)} more candidates: see --json"
    return [*table_lines(header, rows, width, indent="  "), *wrapped(caption, width)]


def _short(number: float) -> str:
    """Return the number in at most six characters."""
    if not math.isfinite(number):
        return "—"
    if abs(number) < 10:
        return f"{number:.2f}"
    return f"{number:.0f}" if number < 1e6 else f"{number:.0e}"
