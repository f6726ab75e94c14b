"""Results of a run in words: headline, parameters, notes and uncertainty budget."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from acquisition.measure.type_a import noise_ratio
from acquisition.results.damage import damage_text
from acquisition.results.effects.lamp_level import DRIFT, WANDER
from acquisition.results.effects.lens import STRAY, VIGNETTING, WALLS
from acquisition.results.effects.polarisation import CAMERA, LAMP
from acquisition.results.effects.rig_effects import stated_sizes
from acquisition.results.effects.sensor import DARK_DRIFT, FLAT, NONLINEAR
from acquisition.results.effects.surface import (
    TILE_AGED,
    TILE_TILT,
    TILE_TILT_ACROSS,
    TILT,
    TILT_ACROSS,
    ZEROS,
)
from acquisition.results.effects.turning import turning_note
from acquisition.results.facts.chosen_geometries import choice_note
from acquisition.results.fitting import Fitted, u_without
from acquisition.results.reduction import (
    DARK,
    LINEARITY,
    NOISE,
    PLACEMENT,
    ROUNDING,
    TEXTURE,
    TILE,
    TILE_PLACEMENT,
    TILE_READING,
    Reduced,
    standard_of,
)
from analysis.choice.choice import Choice
from analysis.choice.notes import NoteCode
from analysis.data.covariance import ANGLES
from analysis.fit.fit import FitResult
from analysis.fit.shared_values import shared_values
from analysis.report.data import Parameter
from analysis.report.style import format_value
from instrument.config.load import Loaded
from instrument.geometry import FloatArray
from instrument.record.event_kinds import EXPOSURE, INTERLOCK, RESUMED, RETRY
from instrument.record.reading import batches_of
from instrument.record.record import Record

Budget = tuple[tuple[str, float, float], ...]

FEW_BITS = 8  # of a camera whose rounding deserves a note
NOTABLE_PULL = 2.0  # in u
_NOTABLE_SCATTER = 1.5  # measured over predicted
_TOLD_SHARE = 0.7  # of the stated u of an effect, below which the data tell its size
VERDICTS = {
    "adequate": "the simplest model that explains the data within their uncertainty",
    "none adequate": "the best of the models, but none explains the data within their uncertainty",
    "not identifiable": "agrees with the data, but they do not determine all of its parameters",
}
# Kinds of components, as a chart shows them.
_SOURCES = {
    **dict.fromkeys((NOISE, ROUNDING), "noise"),
    **dict.fromkeys((DARK, DARK_DRIFT), "dark"),
    **dict.fromkeys((DRIFT, WANDER), "lamp drift"),
    **dict.fromkeys((LINEARITY, NONLINEAR), "linearity"),
    **dict.fromkeys((FLAT, VIGNETTING), "flat field"),
    **dict.fromkeys((STRAY, WALLS), "stray light"),
    **dict.fromkeys((LAMP, CAMERA), "polarisation"),
    **dict.fromkeys((TILE, TILE_READING, TILE_PLACEMENT, TILE_AGED), "white tile"),
    **dict.fromkeys((TILE_TILT, TILE_TILT_ACROSS), "white tile"),
    **dict.fromkeys((TILT, TILT_ACROSS, PLACEMENT, TEXTURE), "place and tilt of the sample"),
    **dict.fromkeys((ANGLES, *ZEROS.values()), "angles"),
}
_PAPER_RATIO = "ks/albedo"
_UNITS = {"degrees": "°", "1": ""}


def headline(fitted: Fitted) -> str:
    """Return the chosen model and the verdict on it, in one sentence."""
    return verdict_sentence(fitted.choice, fitted.reason)


def verdict_sentence(choice: Choice | None, reason: str) -> str:
    """Return the chosen model and the verdict on it; the reason where no model was fitted."""
    if choice is None or choice.chosen is None:
        return f"No model was fitted: {reason}."
    return f"{choice.chosen}: {VERDICTS[choice.verdict]}."


def value_text(parameter: Parameter) -> str:
    """Return a parameter's value with its uncertainty, or its interval if it has no u."""
    if parameter.u is not None or parameter.interval is None:
        return format_value(parameter.value, parameter.u, parameter.unit)
    low, high = parameter.interval
    return f"not determined, within [{low:.4g}, {high:.4g}] {parameter.unit}".rstrip()


def parameters_of(result: FitResult) -> tuple[Parameter, ...]:
    """Return a candidate's parameters in the model's order, and the ratios of its scales."""
    parameters = (
        Parameter(
            name=p.name,
            value=result.values[p.name],
            u=result.u[p.name],
            interval=result.intervals.get(p.name),
            unit=_UNITS.get(p.unit, p.unit),
        )
        for p in result.problem.model.parameters
    )
    ratios = (
        Parameter(name=name, value=r.value, u=r.u, interval=r.interval, unit="")
        for name, r in result.ratios.items()
    )
    return (*parameters, *ratios)


def paper_ratio_note(chosen: FitResult) -> str:
    """Return the lobe's strength as the 1995 paper states it: k_s/k_d, beside an albedo rho.

    The paper's lobe (37) leaves out the factor 1/4, and its diffuse part is k_d times that of a
    surface with the albedo rho: k_d = albedo / rho.
    """
    ratio = chosen.ratios.get(_PAPER_RATIO)
    if ratio is None or ratio.u is None:
        return ""
    text = "k_s/k_d as in Oren and Nayar (1995), whose lobe (37) leaves out the factor 1/4, is "
    ks, u_ks = chosen.values["ks"], chosen.u["ks"]
    if u_ks is not None and chosen.u["albedo"] is not None:
        return f"{text}ks/4 = {format_value(ks / 4, u_ks / 4, '')}, for rho = albedo and k_d = 1"
    quarter = format_value(ratio.value / 4, ratio.u / 4, "")
    return f"{text}rho times {quarter} = ks/albedo/4, where rho is the albedo"


def budget(parts: Mapping[str, FloatArray]) -> Budget:
    """Return rows of (component, median relative u in %, share of the variance in %).

    The largest share comes first. `parts`: relative u by component, (N,).
    """
    variances = {name: u[np.isfinite(u)] ** 2 for name, u in parts.items()}
    variances = {name: v for name, v in variances.items() if v.size}
    whole = sum(float(np.mean(v)) for v in variances.values())
    rows = [
        (name, 100 * float(np.median(np.sqrt(v))), 100 * float(np.mean(v)) / whole)
        for name, v in variances.items()
    ]
    return tuple(sorted(rows, key=lambda row: -row[2]))


def sources_of(parts: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Combine the components of one kind: relative u (N,) by source, for a chart."""
    found: dict[str, FloatArray] = {}
    for name, u in parts.items():
        source = _SOURCES.get(name, name)
        found[source] = np.hypot(found.get(source, 0.0), np.nan_to_num(u))
    return found


def notes(reduced: Reduced, fitted: Fitted, record: Record, loaded: Loaded) -> tuple[str, ...]:
    """Return everything else that the operator should know, one sentence each."""
    of_fit = () if fitted.choice is None else fitted.choice.notes
    found = (
        "" if loaded.rig.real else "all data are simulated",
        damage_text(record),
        _unfinished_note(record),
        _interruptions_note(record),
        _interlock_note(record),
        fitted.reason if fitted.choice is not None else "",
        *(note.text for note in of_fit if note.code != NoteCode.SEARCH_END),
        paper_ratio_note(fitted.chosen) if fitted.chosen is not None else "",
        choice_note(record),
        _hidden_note(record),
        _flag_note(reduced),
        _drift_note(reduced),
        turning_note(reduced.points),
        _scatter_note(reduced, loaded),
        _pull_note(fitted),
        _effects_note(fitted, loaded),
        _bits_note(reduced, fitted, loaded),
        _exposure_note(reduced, record),
        _tile_note(reduced, loaded),
    )
    return tuple(note for note in found if note)


def _exposure_note(reduced: Reduced, record: Record) -> str:
    """Name the exposures that no comparison of counts has confirmed."""
    found = [text for _, kind, text in record.events() if kind == EXPOSURE]
    used = sorted({point.exposure_s for point in reduced.points})
    bare = [f"{e:g} s" for e in used if not any(f" {e:g} s" in text for text in found)]
    if not bare:
        return ""
    return (
        f"exposures that no comparison of counts has confirmed (too bright or too dark): "
        f"{', '.join(bare)}"
    )


def _tile_note(reduced: Reduced, loaded: Loaded) -> str:
    """State the radiance factor of the white tile away from its certificate, and its u."""
    tile = loaded.protocol.references.white_tile
    found = standard_of(reduced.points, loaded.protocol)
    if tile is None or found is None:
        return ""
    if tile.values is not None:
        return (
            f"the white tile's radiance factor is {_span(found.beta)} at the angles of its "
            "readings, linear between the values of its table"
        )
    if tile.certificate is None:
        return (
            "the white tile is assumed to be Lambertian; sintered PTFE is not, by some 4 % at 30 "
            "and 60 deg and 7 % at 0 and 70 deg: state its certificate or a table in the protocol"
        )
    if tile.certificate == "lambertian":
        return "the white tile is Lambertian by its certificate in the protocol"
    if not found.departure.any():
        return f"the white tile's number is used at its certificate's geometry, {tile.certificate}"
    return (
        f"the white tile's number is certified at {tile.certificate} and used elsewhere: a u of "
        f"{_span(100 * found.departure)} % is added; a table of its radiance factor has less"
    )


def _span(values: FloatArray) -> str:
    low, high = f"{np.min(values):.4g}", f"{np.max(values):.4g}"
    return low if low == high else f"{low} to {high}"


def _hidden_note(record: Record) -> str:
    hidden = int(record.meta("hidden") or 0)
    geometries = "1 geometry" if hidden == 1 else f"{hidden} geometries"
    return f"{geometries} left out: camera and lamp hide one another" if hidden else ""


def _flag_note(reduced: Reduced) -> str:
    flagged = [flags for flags in reduced.flags if flags]
    if not flagged:
        return ""
    kinds = ", ".join(sorted({kind for flags in flagged for kind in flags.split("; ")}))
    return f"{len(flagged)} of {len(reduced.flags)} points are flagged and not fitted: {kinds}"


def scan_state(record: Record) -> str:
    """Return that the scan is complete, recorded and reported, or what is missing of it."""
    return _unfinished_note(record) or "the run is complete: all readings are recorded and reported"


def _unfinished_note(record: Record) -> str:
    planned, made = int(record.meta("steps") or 0), len(record.readings())
    if made >= planned:
        return ""
    choices = batches_of(record.events())
    if choices and not choices[-1].end:
        return (
            f"the scan is not finished: {made} readings, of geometries that it chooses; go on "
            f"with: gonio resume {record.folder}"
        )
    return (
        f"the scan is not finished: {made} of {planned} readings; go on with: "
        f"gonio resume {record.folder}"
    )


def _interruptions_note(record: Record) -> str:
    """Interruptions of the scan, jumps of the lamp meanwhile, and retries."""
    kinds = [kind for _, kind, _ in record.events()]
    resumed, retries = kinds.count(RESUMED), kinds.count(RETRY)
    jumps = sum(check.jumped for check in record.checks())
    times = "1 time" if jumps == 1 else f"{jumps} times"
    texts = (
        f"the scan was interrupted {resumed} times" if resumed else "",
        f"the lamp level had jumped {times} and is followed from there" if jumps else "",
        f"{retries} retries and warnings, see the events in the record" if retries else "",
    )
    return "; ".join(text for text in texts if text)


def _interlock_note(record: Record) -> str:
    """First of the things that contradicted the physics, and the number of all."""
    found = list(dict.fromkeys(text for _, kind, text in record.events() if kind == INTERLOCK))
    if not found:
        return ""
    more = f" ({len(found) - 1} more, see the events in the record)" if found[1:] else ""
    return f"interlocks noted: {found[0]}{more}"


def _drift_note(reduced: Reduced) -> str:
    if not reduced.drift_checks:
        return "no drift check was made: the lamp is assumed to be constant"
    ranges = [np.ptp(level) for level in reduced.drift_levels if level.size > 1]
    unusable = reduced.drift_checks - sum(level.size for level in reduced.drift_levels)
    text = f"{unusable} of {reduced.drift_checks} drift checks are flagged or too dark to use"
    if not ranges:
        return f"{text}: the lamp is assumed to be constant"
    note = f"lamp drift corrected: up to {100 * max(ranges):.2f} % at one lamp setting"
    return f"{note}; {text}" if unusable else note


def _pull_note(fitted: Fitted) -> str:
    """Shared errors whose fitted value is unlikely for their u."""
    pulls = fitted.chosen.pulls if fitted.chosen is not None else {}
    large = [f"{name}, {pull:+.1f} u" for name, pull in pulls.items() if abs(pull) > NOTABLE_PULL]
    return f"large shared errors in the fit: {'; '.join(large)}" if large else ""


def _scatter_note(reduced: Reduced, loaded: Loaded) -> str:
    """Scatter of frames and of drift checks that is far above what noise predicts."""
    frames = noise_ratio(reduced.points, loaded.rig.camera)
    texts = (
        f"frames of one reading scatter {frames:.2g} times as much as photons and read-out explain "
        "(median): the lamp flickers, or full_well_electrons in the rig file is too large"
        if frames > _NOTABLE_SCATTER
        else "",
        f"drift checks scatter {reduced.drift_scatter:.2g} times as much as their noise about a "
        "steady drift: the lamp wanders between them; let it warm up, or lower every_points"
        if reduced.drift_scatter > _NOTABLE_SCATTER
        else "",
    )
    found = "; ".join(text for text in texts if text)
    return f"{found}. The larger scatter is in the uncertainty" if found else ""


def _effects_note(fitted: Fitted, loaded: Loaded) -> str:
    """Sizes of the rig file's effects that the data tell more closely, as the chosen model fits."""
    choice, chosen = fitted.choice, fitted.chosen
    if choice is None or chosen is None or chosen.model not in choice.agreeing:
        return ""
    stated = stated_sizes(loaded.rig.uncertainty)
    texts = []
    for found in shared_values(chosen):
        if found.name in stated and found.u < _TOLD_SHARE:
            size, u, unit = stated[found.name]
            value = format_value(size + found.value * u, found.u * u, unit)
            texts.append(f"{found.name} {value} (stated: {size:.2g} ± {u:.2g} {unit})")
    return f"the data suggest, if {chosen.model} holds: {'; '.join(texts)}" if texts else ""


def _bits_note(reduced: Reduced, fitted: Fitted, loaded: Loaded) -> str:
    """Effect of rounding to whole counts on points and parameters, for a camera of few bits."""
    bits = loaded.rig.camera.bit_depth
    if bits > FEW_BITS or fitted.chosen is None:
        return ""
    used = fitted.used
    rounding = 100 * np.hypot(reduced.parts[ROUNDING], reduced.parts[DARK])[used]
    noise = 100 * np.median(reduced.parts[NOISE][used])
    text = (
        f"{bits}-bit camera: rounding frames and darks to whole counts gives each point a relative "
        f"u of {np.median(rounding):.2g} % (median; largest {rounding.max():.2g} %), beside "
        f"{noise:.2g} % of noise"
    )
    changes = [
        f"u({name}) {without:.2g} instead of {u:.2g}"
        for name, (u, without) in u_without((ROUNDING, DARK), fitted, reduced).items()
    ]
    return f"{text}; without rounding {', '.join(changes)}" if changes else text
