"""What the results say in words: the headline, the notes, the uncertainty budget."""

from __future__ import annotations

import numpy as np

from acquisition.results.fitting import Fitted, cost_of
from acquisition.results.reduction import DARK, NOISE, ROUNDING, Reduced
from analysis.fit.fit import FitResult
from analysis.report.data import Parameter
from analysis.report.style import format_value
from instrument.config.load import Loaded
from instrument.geometry import FloatArray
from instrument.record.event_kinds import RESUMED, RETRY
from instrument.record.record import Record

Budget = tuple[tuple[str, float, float], ...]

FEW_BITS = 8
_UNITS = {"degrees": "°", "1": ""}
VERDICTS = {
    "adequate": "the simplest model that explains the data within their uncertainty",
    "none adequate": "the best of the models, but none explains the data within their uncertainty",
    "not identifiable": "agrees with the data, but they do not determine all of its parameters",
}
NOTABLE_PULL = 2.0


def headline(fitted: Fitted) -> str:
    """Which model was chosen and the verdict on it, in one sentence."""
    if fitted.choice is None or fitted.chosen is None:
        return f"No model was fitted: {fitted.reason}."
    return f"{fitted.chosen.model}: {VERDICTS[fitted.choice.verdict]}."


def value_text(parameter: Parameter) -> str:
    """A parameter's value with its uncertainty, or the interval that is all one can say."""
    if parameter.u is not None:
        return format_value(parameter.value, parameter.u, parameter.unit)
    low, high = parameter.interval or (np.nan, np.nan)
    return f"not determined, within [{low:.4g}, {high:.4g}] {parameter.unit}".rstrip()


def parameters_of(result: FitResult) -> tuple[Parameter, ...]:
    """A candidate's parameters in the model's order."""
    return tuple(
        Parameter(
            name=p.name,
            value=result.values[p.name],
            u=result.u[p.name],
            interval=result.intervals.get(p.name),
            unit=_UNITS.get(p.unit, p.unit),
        )
        for p in result.problem.model.parameters
    )


def budget(reduced: Reduced, u_brdf: FloatArray) -> Budget:
    """Rows of (component, median relative u in %, share of the variance in %), largest first."""
    parts = {name: u**2 for name, u in reduced.parts.items()}
    known = np.isfinite(reduced.brdf)
    if known.any():
        total = (u_brdf / reduced.brdf) ** 2
        # What the fit's total has beyond all other parts.
        parts["angle setting"] = np.maximum(total - np.sum(list(parts.values()), axis=0), 0.0)
        parts = {name: part[known] for name, part in parts.items()}
    whole = sum(float(np.mean(p)) for p in parts.values())
    rows = [
        (name, 100 * float(np.median(np.sqrt(p))), 100 * float(np.mean(p)) / whole)
        for name, p in parts.items()
    ]
    return tuple(sorted(rows, key=lambda row: -row[2]))


def notes(reduced: Reduced, fitted: Fitted, record: Record, loaded: Loaded) -> tuple[str, ...]:
    """What else the operator should know."""
    tile = "the white tile is taken as Lambertian" if reduced.shared_by_tile else ""
    found = (
        "" if loaded.rig.real else "all data are simulated",
        _unfinished_note(record),
        _interruptions_note(record),
        fitted.reason if fitted.choice is not None else "",
        validity_note(fitted.chosen) if fitted.chosen is not None else "",
        _hidden_note(record),
        _flag_note(reduced),
        _drift_note(reduced),
        _pull_note(fitted),
        _bits_note(reduced, fitted, loaded),
        tile,
    )
    return tuple(note for note in found if note)


def validity_note(chosen: FitResult) -> str:
    """At how many points the fitted model is beyond what it holds for, and why."""
    holds = chosen.validity
    beyond = int(np.sum(~holds.mask))
    if not beyond:
        return ""
    return (
        f"at {beyond} of {holds.mask.size} points the model is beyond what it holds for: "
        f"{holds.reason}"
    )


def _hidden_note(record: Record) -> str:
    hidden = int(record.meta("hidden") or 0)
    return f"{hidden} geometries left out: camera and lamp hide one another" if hidden else ""


def _flag_note(reduced: Reduced) -> str:
    flagged = [flags for flags in reduced.flags if flags]
    if not flagged:
        return ""
    kinds = ", ".join(sorted({kind for flags in flagged for kind in flags.split("; ")}))
    return f"{len(flagged)} of {len(reduced.flags)} points are flagged and not fitted: {kinds}"


def _unfinished_note(record: Record) -> str:
    planned, made = int(record.meta("steps") or 0), len(record.readings())
    if made >= planned:
        return ""
    return (
        f"the scan is not finished: {made} of {planned} readings; go on with: "
        f"gonio resume {record.folder}"
    )


def _interruptions_note(record: Record) -> str:
    """How often the scan went on after a stop, what the lamp had done, and what was tried again."""
    kinds = [kind for _, kind, _ in record.events()]
    resumed, retries = kinds.count(RESUMED), kinds.count(RETRY)
    jumps = sum(check.jumped for check in record.checks())
    texts = (
        f"the scan was interrupted {resumed} times" if resumed else "",
        f"the lamp had jumped at {jumps} of them, its level is counted anew there" if jumps else "",
        f"devices were asked again {retries} times (events in the record)" if retries else "",
    )
    return "; ".join(text for text in texts if text)


def _drift_note(reduced: Reduced) -> str:
    if not reduced.drift_checks:
        return "no drift check was made: the lamp is taken as constant"
    followed = [np.ptp(level) for level in reduced.drift_levels if level.size > 1]
    unusable = reduced.drift_checks - sum(level.size for level in reduced.drift_levels)
    text = f"{unusable} of {reduced.drift_checks} drift checks are flagged or too dark to use"
    if not followed:
        return f"{text}: the lamp is taken as constant"
    percent = 100 * max(followed)
    note = f"the lamp's drift was followed and taken out: up to {percent:.2f} % at one setting"
    return f"{note}; {text}" if unusable else note


def _pull_note(fitted: Fitted) -> str:
    """Shared errors that the fit puts further off than their u makes likely."""
    pulls = fitted.chosen.pulls if fitted.chosen is not None else {}
    far = [f"{name} by {pull:+.1f} u" for name, pull in pulls.items() if abs(pull) > NOTABLE_PULL]
    return f"to agree with the model, the fit takes to be off: {', '.join(far)}" if far else ""


def _bits_note(reduced: Reduced, fitted: Fitted, loaded: Loaded) -> str:
    """What a camera of few bits costs: its share of u, and what the parameters lose by it."""
    bits = loaded.rig.camera.bit_depth
    if bits > FEW_BITS or fitted.chosen is None:
        return ""
    used = fitted.used
    rounding = np.hypot(reduced.parts[ROUNDING], reduced.parts[DARK])[used]
    text = (
        f"what {bits} bits cost: rounding frames and darks to whole counts gives every point a "
        f"relative u of {100 * np.median(rounding):.2g} % (median; worst "
        f"{100 * rounding.max():.2g} %) beside {100 * np.median(reduced.parts[NOISE][used]):.2g} "
        "% of noise"
    )
    cost = cost_of((ROUNDING, DARK), reduced, fitted.chosen, loaded)
    gains = [f"u({name}) {u:.2g} instead of {now:.2g}" for name, (now, u) in cost.items()]
    return f"{text}; without it {', '.join(gains)}" if gains else text
