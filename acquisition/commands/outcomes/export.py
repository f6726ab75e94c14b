"""Command `gonio export`: a run, or a table, in the format of another program."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from acquisition.facility.exporting import (
    DOCUMENTS,
    TILED,
    export_documents,
    export_to_tiled,
)
from acquisition.results.fitting import Fitted, fit_run
from acquisition.results.measurements_csv import measurements_csv
from acquisition.results.reduction import Reduced, reduced_run, require_usable
from acquisition.results.run_folder import load_run_inputs
from acquisition.terminal.console import out, print_notes
from acquisition.terminal.progress import sign_of_life
from analysis.exchange.exported import BrdfTable, Export, ExportedModel
from analysis.exchange.formats import FORMATS, Format
from instrument.config.load import Loaded
from instrument.errors import InputError
from instrument.geometry import BoolArray, Geometry
from instrument.record.record import Record
from instrument.text.atomic_file import write_whole
from instrument.text.quoting import printable


def export_to(run: Path, name: str, path: Path | None, url: str | None) -> None:
    """Write a run in the format `name` to a file, or to a server at `url`; print where it is.

    Raises `InputError` without the one that the format needs, or with the other.
    """
    if (url is not None) != (name == TILED):
        wanted = "missing" if name == TILED else f"for the format {printable(name)}"
        raise InputError(f"--to: {wanted}; a Tiled server's address belongs to --format {TILED}")
    if (path is not None) == (name == TILED):
        wanted = f"for the format {TILED}, which writes no file" if path else "missing: name a file"
        raise InputError(f"--output: {wanted}")
    if url is not None:
        export_to_tiled(run, url)
    elif path is not None and name == DOCUMENTS:
        export_documents(run, path)
    elif path is not None:
        export_run(run, name, path)


def export_run(run: Path, name: str, path: Path) -> None:
    """Write a run in the format `name` to `path` and print the files' names.

    All files are composed before the first is written, and none replaces another. Points with a
    flag are left out, which is printed. Raises `InputError` for a format or a name that is not
    allowed, for a run that the format cannot hold, and for a file that exists.
    """
    wanted = _format(name, path)
    with Record.open(run) as record:
        loaded = load_run_inputs(record)
        reduced = reduced_run(record, loaded)
    require_usable(reduced)
    with sign_of_life(f"fit of {len(reduced.points)} points"):
        fitted = fit_run(reduced, loaded)
    kept = reduced.valid
    export = _export(reduced, fitted, loaded, kept)
    with sign_of_life(f"{name} file"):
        files = {path.with_name(file): data for file, data in wanted.files(export, path.stem)}
    _write(files)
    for file in files:
        out.print(str(file), highlight=False, soft_wrap=True)
    flagged = int(np.sum(~kept))
    if flagged and not wanted.holds_flagged:
        print_notes((f"{flagged} of {kept.size} points are flagged and left out",))


def _write(files: Mapping[Path, bytes]) -> None:
    """Write all files, or none if one of them exists."""
    taken = [str(file) for file in files if file.exists()]
    if taken:
        raise InputError(f"{', '.join(taken)}: exists already: choose another name for --output")
    for file, content in files.items():
        write_whole(file, content, new=True)


def _format(name: str, path: Path) -> Format:
    """Return the format of this name, for a file whose name fits it."""
    if name not in FORMATS:
        allowed = (*FORMATS, DOCUMENTS, TILED)
        near = difflib.get_close_matches(name.lower(), allowed, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise InputError(f"--format: {printable(name)}; allowed: {', '.join(allowed)}{hint}")
    wanted = FORMATS[name]
    if path.suffix.lower() != wanted.suffix:
        raise InputError(f"{path}: --output must end in {wanted.suffix} for the format {name}")
    return wanted


def _export(reduced: Reduced, fitted: Fitted, loaded: Loaded, kept: BoolArray) -> Export:
    points = [p for p, keep in zip(reduced.points, kept, strict=True) if keep]
    geometry = Geometry.from_degrees(
        theta_i=[p.theta_i_deg for p in points],
        theta_r=[p.theta_r_deg for p in points],
        dphi=[p.dphi_deg for p in points],
    )
    if reduced.has_brdf:
        brdf, u_brdf = reduced.brdf[kept], fitted.u_brdf(reduced)[kept]
    else:
        scale = 1 / np.cos(geometry.theta_i)
        brdf, u_brdf = reduced.radiance[kept] * scale, reduced.u_radiance[kept] * scale
    table = BrdfTable(
        geometry=geometry,
        brdf=brdf,
        u_brdf=u_brdf,
        relative=not reduced.has_brdf,
        source_sr=loaded.rig.source_solid_angle_sr,
        receiver_sr=loaded.rig.receiver_solid_angle_sr,
    )
    parts = fitted.parts(reduced)
    return Export(
        table=table,
        own_table=measurements_csv(reduced, fitted.u_brdf(reduced), parts, loaded),
        facts=_facts(reduced, loaded),
        model=_model(fitted),
        no_model=fitted.reason,
    )


def _model(fitted: Fitted) -> ExportedModel | None:
    chosen = fitted.chosen
    if fitted.choice is None or chosen is None:
        return None
    verdict = fitted.choice.verdict
    return ExportedModel(
        name=chosen.model, verdict=verdict, values=chosen.values, u=chosen.u, brdf=chosen.brdf
    )


def _facts(reduced: Reduced, loaded: Loaded) -> Mapping[str, str]:
    """Facts that every format carries which has a place for them."""
    protocol, times = loaded.protocol, [p.time_utc for p in reduced.points]
    return {
        "sample": protocol.sample.name,
        "measurement": protocol.name,
        "rig": loaded.rig.name,
        "measured_utc": f"{min(times)} to {max(times)}",
        **protocol.metadata.given(),
    }
