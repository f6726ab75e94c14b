"""Sources of `gonio fit`: runs, tables of this and of other programs, the CUReT database."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from acquisition.results.damage import damage_text
from acquisition.results.fitting import measurements
from acquisition.results.reduction import reduced_run, require_usable
from acquisition.results.run_folder import load_run_inputs
from analysis.choice.notes import Note, NoteCode
from analysis.data.acceptance import Acceptance
from analysis.data.csv.table import CsvTable, table_of
from analysis.data.curet import TABLE, VALUES, read_curet
from analysis.data.measurements import Measurements, SharedError
from analysis.data.repeats import Repeats, mean_of_repeats
from analysis.exchange.conventions import from_mirror_azimuth, without_cosine
from analysis.exchange.dense.merl_reader import (
    LARGEST_DEG,
    STEP_DEG,
    THETA_I_DEG,
    is_merl,
    read_merl,
)
from analysis.exchange.imports import READERS, kind_of, read_foreign
from instrument.config.protocol import FitConfig, WhiteTile
from instrument.errors import AllFlagged, InputError, NoMeasurement, NotDetermined
from instrument.record.record import FILE_NAME, Record
from instrument.text.quoting import printable
from instrument.text.text_file import TextFile, read_text

_U_NAME = re.compile(r"(u|unc|uncertainty|err|error|std|sd|sigma|stdev|σ)(\b|_)", re.IGNORECASE)
FORMATS = ("auto", "run", "csv", "curet", "merl", *READERS)


@dataclass(frozen=True, slots=True)
class Source:
    """Measurements, the rig's acceptance if it is known, and remarks: points left out, assumptions.

    fit: the models and the method that a run's protocol names. sample, tile: name of a run's sample
    and its white tile, empty and None where they are not known. polariser_deg: angle of a run's
    polariser before the camera from the plane of incidence, None without one.
    """

    measurements: Measurements
    acceptance: Acceptance | None
    notes: tuple[Note, ...]
    fit: FitConfig = field(default_factory=FitConfig)
    sample: str = ""
    tile: WhiteTile | None = None
    polariser_deg: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """Selection from a source.

    format: one of FORMATS. sample: number of the material, for a database. max_theta_deg: largest
    theta_i and theta_r. relative: the values have no absolute scale. u_shared: relative u of an
    error that all values share, None if there is none; a run states its own. repeats: "mean"
    averages rows of the same geometry in a table; None refuses them. cosine_corrected: the values
    of a table are the BRDF times cos(theta_r). mirror_azimuth: its azimuth 0 is the mirror side.
    """

    format: str = "auto"
    sample: int | None = None
    max_theta_deg: float = 90.0
    relative: bool = False
    u_shared: float | None = None
    repeats: str | None = None
    cosine_corrected: bool = False
    mirror_azimuth: bool = False


def read_source(path: Path, wanted: Wanted) -> Source:
    """Read a source.

    Raises `InputError` for wrong input, `NoMeasurement` if no point is left, `AllFlagged` if those
    of a run are all flagged, `NotDetermined` if its values are outside their domain.
    """
    require_wanted(wanted)
    kind = _kind(path) if wanted.format == "auto" else wanted.format
    if (wanted.sample is not None) != (kind == "curet"):
        raise InputError(
            f"--sample: {'missing' if kind == 'curet' else wanted.sample} for the format {kind}; "
            "it names a material of the curet format, and is allowed only there"
        )
    if wanted.u_shared is not None and kind == "run":
        raise InputError(
            f"--u-shared: {wanted.u_shared:g} for a run, which states its own shared errors; "
            "allowed for tables"
        )
    if (wanted.cosine_corrected or wanted.mirror_azimuth) and kind in ("run", "curet", "merl"):
        option = "--cosine-corrected" if wanted.cosine_corrected else "--mirror-azimuth"
        raise InputError(f"{option}: for a {kind}, whose conventions are known; allowed for tables")
    if kind == "curet":
        source = _curet(path, wanted)
    else:
        source = _read(path, kind, wanted)
        source = _restated(_cut(source, wanted.max_theta_deg), wanted)
    if wanted.relative:
        source = replace(source, measurements=replace(source.measurements, relative=True))
    if source.measurements.size == 0:
        raise NoMeasurement("no point is left to fit")
    return source


def require_wanted(wanted: Wanted) -> None:
    """Raise `InputError` for a selection that is wrong for every source."""
    if wanted.repeats not in (None, "mean"):
        raise InputError(f"--repeats: {printable(wanted.repeats or '')}; allowed: mean")
    if wanted.format not in FORMATS:
        raise InputError(f"--format: {wanted.format}; allowed: {', '.join(FORMATS)}")
    if not 0 < wanted.max_theta_deg <= 90:
        raise InputError(
            f"--max-theta-deg: {wanted.max_theta_deg:g} degrees; allowed: above 0, up to 90 degrees"
        )


def _kind(path: Path) -> str:
    if not path.is_dir():
        if (path.parent / FILE_NAME).is_file() and path.suffix != ".csv":
            folder = path.parent
            raise InputError(
                f"{path}: is no table; name the folder of its run, {folder}, or its "
                f"{folder / 'measurements.csv'}"
            )
        return "merl" if is_merl(path) else "csv"
    if (path / FILE_NAME).exists():
        return "run"
    if all((path / name).is_file() for name in (TABLE, VALUES)):
        return "curet"
    if _pab_files(path):
        return "pab"
    raise InputError(
        f"{path}: a folder without {FILE_NAME} is no run; name a run's folder or a CSV file, or "
        "add --format curet --sample N for a folder of the CUReT database"
    )


def _run(path: Path) -> Source:
    with Record.open(path) as record:
        loaded = load_run_inputs(record)
        reduced = reduced_run(record, loaded)
        damage = damage_text(record)
    require_usable(reduced)
    left_out = (Note(NoteCode.DAMAGED, damage),) if damage else ()
    notes = left_out + _flagged(int(np.sum(~reduced.valid)), reduced.valid.size)
    acceptance = Acceptance.of(loaded.rig, loaded.protocol.window)
    try:
        found = measurements(reduced, loaded)
    except ValueError as error:  # values outside their domain, such as a u of 0
        raise NotDetermined(str(error)) from None
    protocol = loaded.protocol
    tile = protocol.references.white_tile
    angle_deg = protocol.polariser_deg
    return Source(found, acceptance, notes, protocol.fit, protocol.sample.name, tile, angle_deg)


def _read(path: Path, kind: str, wanted: Wanted) -> Source:
    if kind == "run":
        return _run(path)
    return _merl(path, wanted) if kind == "merl" else _table(path, kind, wanted)


def _table(path: Path, kind: str, wanted: Wanted) -> Source:
    """Read a table; without a format asked for, its content tells which one it is."""
    if kind == "pab" and path.is_dir():
        return _foreign([read_text(file) for file in _pab_files(path)], kind, wanted)
    file = read_text(path, pipe=True)
    found = kind_of(file) or kind if wanted.format == "auto" else kind
    return _csv(file, wanted) if found == "csv" else _foreign([file], found, wanted)


def _pab_files(folder: Path) -> list[Path]:
    """Files of a folder that hold one scan by pab-opto: one for each incidence."""
    return sorted(folder.glob("*.pab"))


def _csv(file: TextFile, wanted: Wanted) -> Source:
    table = table_of(file, repeats=wanted.repeats is not None)
    m = table.measurements
    if not m.size:
        raise AllFlagged(f"all {table.flagged} points are flagged: there is nothing to fit")
    notes = _flagged(table.flagged, table.flagged + m.size) + _ignored_u(table)
    source = _averaged(Source(m, table.acceptance, notes), wanted)
    return _with_assumptions(source, wanted, states_shared=table.states_shared)


def _foreign(files: Sequence[TextFile], kind: str, wanted: Wanted) -> Source:
    m = read_foreign(files, kind, repeats=wanted.repeats is not None)
    source = _averaged(Source(m, None, ()), wanted)
    return _with_assumptions(source, wanted, states_shared=False)


def _merl(path: Path, wanted: Wanted) -> Source:
    found = read_merl(path)
    m, incidences = found.measurements, ", ".join(f"{a:g}" for a in THETA_I_DEG)
    text = (
        f"{m.size} of the directions of a MERL file, interpolated between its cells: theta_i "
        f"{incidences} degrees, views in steps of {STEP_DEG:g} degrees up to {LARGEST_DEG:g} in "
        "the plane of incidence and across it, closer together at the mirror direction"
    )
    if found.without:
        text += f"; {found.without} more have no value"
    if not found.alike:
        text += "; red, green and blue are taken together as luminance (ITU-R BT.709)"
    source = Source(m, None, (Note(NoteCode.DIRECTIONS, text),))
    return _with_assumptions(source, wanted, states_shared=False)


def _flagged(flagged: int, points: int) -> tuple[Note, ...]:
    text = f"{flagged} of {points} points are flagged and not fitted"
    return (Note(NoteCode.FLAGGED, text),) if flagged else ()


def _ignored_u(table: CsvTable) -> tuple[Note, ...]:
    """Columns that seem to hold uncertainties, in a table that states none."""
    names = [printable(name[:40]) for name in table.ignored if _U_NAME.match(name)]
    if not names or table.measurements.u_random is not None:
        return ()
    text = (
        f"not read: {', '.join(names[:8])}; an uncertainty is read from u_brdf, in 1/sr, or "
        "u_independent_relative, relative to the value"
    )
    return (Note(NoteCode.IGNORED_U, text),)


def _averaged(source: Source, wanted: Wanted) -> Source:
    """Average rows of the same geometry, where that is wanted."""
    if wanted.repeats is None:
        return source
    m, repeats = mean_of_repeats(source.measurements)
    return replace(source, measurements=m, notes=source.notes + _repeats(repeats, m))


def _repeats(repeats: Repeats, m: Measurements) -> tuple[Note, ...]:
    if not repeats.geometries:
        return ()
    text = f"{repeats.geometries} of {m.size} geometries are means of {repeats.rows} repeats, which"
    if m.u_random is None:
        text += (
            f" scatter by {100 * repeats.scatter:.2g} % of the mean value; each mean counts once"
        )
    else:
        text += f" scatter by {repeats.scatter:.2g} times their u"
        few = "; the u is too small for what changes between repeats"
        text += few if repeats.exceed_u else ""
    return (Note(NoteCode.REPEATS, text),)


def _with_assumptions(source: Source, wanted: Wanted, *, states_shared: bool) -> Source:
    """Add the requested shared error, and what is assumed as the source does not state it."""
    m, notes = source.measurements, list(source.notes)
    if wanted.u_shared is not None:
        error = SharedError.common_to_all("--u-shared", wanted.u_shared, m.size)
        source = replace(source, measurements=replace(m, shared=(*m.shared, error)))
        text = f"all values share an error of {100 * wanted.u_shared:g} % (--u-shared)"
        notes.append(Note(NoteCode.U_SHARED, text))
    elif not states_shared:
        text = (
            "assumed: no error is shared by several values, such as that of a white tile; if one "
            "is, state its relative u, which the uncertainty of the parameters lacks: --u-shared"
        )
        notes.append(Note(NoteCode.ASSUMED_NO_SHARED_ERROR, text))
    if not any((m.u_theta_i_deg, m.u_theta_r_deg, m.u_dphi_deg)):
        notes.append(Note(NoteCode.ASSUMED_EXACT_ANGLES, "assumed: the angles are exact"))
    if source.acceptance is None:
        text = "assumed: lamp, lens and measured patch are small: no value is a mean over angles"
        notes.append(Note(NoteCode.ASSUMED_SMALL_ACCEPTANCE, text))
    return replace(source, notes=tuple(notes))


def _restated(source: Source, wanted: Wanted) -> Source:
    """Bring a table to the program's own conventions from those that its user named."""
    m, said = source.measurements, []
    if wanted.cosine_corrected:
        m = without_cosine(m)
        said.append("the values were divided by cos(theta_r) (--cosine-corrected)")
    if wanted.mirror_azimuth:
        m = from_mirror_azimuth(m)
        said.append("dphi was turned by 180 degrees (--mirror-azimuth)")
    notes = tuple(Note(NoteCode.RESTATED, text) for text in said)
    return replace(source, measurements=m, notes=source.notes + notes)


def _curet(path: Path, wanted: Wanted) -> Source:
    found = read_curet(path, wanted.sample or 0, wanted.max_theta_deg)
    used, asked = found.measurements.size, found.directions - found.beyond
    text = (
        f"sample {wanted.sample}: {used} of {asked} directions up to {wanted.max_theta_deg:g} "
        f"degrees; {found.negative} negative and {found.zero} zero values masked"
    )
    source = Source(found.measurements, None, (Note(NoteCode.DIRECTIONS, text),))
    return _with_assumptions(source, wanted, states_shared=False)


def _cut(source: Source, max_theta_deg: float) -> Source:
    m = source.measurements
    inside = np.maximum(m.theta_i_deg, np.abs(m.theta_r_deg)) <= max_theta_deg
    if np.all(inside):
        return source
    text = f"{int(np.sum(~inside))} of {m.size} points lie beyond {max_theta_deg:g} degrees"
    notes = (*source.notes, Note(NoteCode.CUT, text))
    return replace(source, measurements=m.subset(inside), notes=notes)
