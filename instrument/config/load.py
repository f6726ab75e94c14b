"""Loading of rig and protocol files, with every mistake reported at once and with its position.

Each mistake is one line: `file:line:column: path: value; allowed: what (advice)`. Values that are
valid by themselves are checked against each other even if others are not.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from instrument.calibration.camera_file import header_text, read_camera_file, read_camera_header
from instrument.calibration.geometry_file import (
    CAMERA_KEYS,
    GeometryCalibration,
    geometry_text,
    read_geometry_file,
    read_geometry_text,
)
from instrument.calibration.tile_file import read_tile_table
from instrument.config.file_role import wrong_role
from instrument.config.protocol import Protocol
from instrument.config.protocol_checks import (
    ModelCheck,
    own_mistakes,
    rig_mistakes,
    through_polariser,
)
from instrument.config.rig import Rig
from instrument.config.schema_words import Explanation
from instrument.config.section import Section
from instrument.config.yaml_file import yaml_bytes
from instrument.config.yaml_positions import KeyPath, Mark, MarkedYaml, dotted, read_yaml
from instrument.errors import InputError
from instrument.text.quoting import printable

MAX_REPORTED = 200  # mistakes per file; more would scroll the first ones off the screen

_MOST_DISTORTION = 0.2  # as that which is typed by hand
_MOST_ZERO_DEG = 5.0  # of a calibrated zero from the one typed by hand

AnySection = TypeVar("AnySection", bound=Section)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loaded:
    """Valid protocol and rig that fit each other, with the texts of their files."""

    protocol: Protocol
    protocol_path: Path
    protocol_text: str
    rig: Rig
    rig_path: Path
    rig_text: str

    @property
    def tile_text(self) -> str | None:
        """Text of the file that holds the white tile's table; None without a table."""
        tile = self.protocol.references.white_tile
        return tile.values.text if tile is not None and tile.values is not None else None

    @property
    def calibration_text(self) -> str | None:
        """Text of the camera's calibration without pixel maps; None without a calibration."""
        measured = self.rig.camera.measured
        return None if measured is None else header_text(measured)

    @property
    def geometry_text(self) -> str | None:
        """Text of the geometry's calibration without its corners; None without a calibration."""
        measured = self.rig.measured
        return None if measured is None else geometry_text(measured)


def load_rig(path: Path, *, calibrated: bool = False) -> Rig:
    """Read a rig file. Raises `InputError` with every mistake in it.

    The calibration of its camera is read only if asked for: most commands have no use for it.
    """
    file = _read(path, Rig)
    rig = _checked_rig(file, None)
    if rig is not None and calibrated:
        rig = _with_calibration(file, rig, None)
    if rig is None or file.found:
        raise InputError(*_report(file))
    return rig


def load_protocol(
    path: Path,
    rig_path: Path | None = None,
    *,
    check_model: ModelCheck | None = None,
    tile_path: Path | None = None,
    calibration_path: Path | None = None,
    geometry_path: Path | None = None,
) -> Loaded:
    """Read a protocol, its rig, the table of its white tile, and the calibrations of its rig.

    `rig_path` replaces the rig that the protocol names, `tile_path` the table of the tile, and
    `calibration_path` and `geometry_path`, a run's copies, the calibrations of camera and geometry.

    `check_model(name, parameters)` returns what is wrong with a model of the protocol, or None;
    parameters are None if the protocol only names the model. Raises `InputError` with every mistake
    in either file and between them.
    """
    file = _read(path, Protocol)
    protocol = file.check(Protocol)
    for at, text in own_mistakes(file.marked, check_model):
        file.add(at, text)
    rig_file = _rig_file(file, rig_path)
    rig = None if rig_file is None else _checked_rig(rig_file, geometry_path)
    if rig_file is not None and file.marked.readable and rig_file.marked.readable:
        for at, text in rig_mistakes(file.marked, rig_file.marked, rig_file.name):
            file.add(at, text)
    files = [file] if rig_file is None else [file, rig_file]
    try:
        protocol = protocol and _with_tile_table(file, protocol, tile_path)
        if rig is not None and rig_file is not None:
            rig = _with_calibration(rig_file, rig, calibration_path)
    except InputError as error:
        raise InputError(*_report(*files), *error.problems) from None
    if protocol is None or rig is None or rig_file is None or any(f.found for f in files):
        raise InputError(*_report(*files))
    return Loaded(
        protocol=_with_polariser(protocol),
        protocol_path=path,
        protocol_text=file.marked.text,
        rig=rig,
        rig_path=rig_file.path,
        rig_text=rig_file.marked.text,
    )


def _read(path: Path, role: type[Section]) -> _File:
    """Read a file. Raises `InputError` if it is none of that role."""
    file = _File(path, read_yaml(yaml_bytes(path)))
    text = None if file.found else wrong_role(file.marked.data, role)
    if text is not None:
        raise InputError(f"{file.name}:1:1: {text}")
    return file


def _rig_file(protocol: _File, rig_path: Path | None) -> _File | None:
    """Return the rig's file, or None, with a mistake added, if the named one cannot be read."""
    if rig_path is not None:
        try:
            return _read(rig_path, Rig)
        except InputError as error:
            raise InputError(*_report(protocol), *error.problems) from None
    named = protocol.marked.get(("rig",))
    if not isinstance(named, str) or not named or ("rig",) in protocol.marked.refused:
        return None
    path = protocol.path.parent / named
    plain = Path(os.path.normpath(path))
    try:
        # After a linked folder, ".." is not the folder that it seems to be.
        path = plain if plain.exists() or not path.exists() else path
        return _read(path, Rig)
    except InputError as error:
        protocol.add(("rig",), error.problems[0])
    except (OSError, ValueError):
        protocol.add(("rig",), f"{named!r}; allowed: the path of a rig file")
    return None


def _with_tile_table(file: _File, protocol: Protocol, path: Path | None) -> Protocol:
    """Return the protocol with the white tile's table; a mistake is added if it cannot be read.

    Raises `InputError` with the mistakes in the table.
    """
    tile = protocol.references.white_tile
    if tile is None or tile.table is None:
        return protocol
    path = path or file.path.parent / tile.table
    try:
        whole = tile.with_values(read_tile_table(path))
    except InputError as error:
        if path.is_file():
            raise
        file.add(("references", "white_tile", "table"), error.problems[0])
        return protocol
    references = protocol.references.model_copy(update={"white_tile": whole})
    return protocol.model_copy(update={"references": references})


def _with_polariser(protocol: Protocol) -> Protocol:
    """Return the protocol with the lobes of its models as its polariser shows them."""
    angle_deg, sample, fit = protocol.polariser_deg, protocol.simulated_sample, protocol.fit
    if angle_deg is None:
        return protocol
    if sample is not None:
        model = through_polariser(sample.model, angle_deg)
        sample = sample.model_copy(update={"model": model})
    models = [through_polariser(name, angle_deg) for name in fit.models or ()]
    fit = fit.model_copy(update={"models": models or None})
    return protocol.model_copy(update={"simulated_sample": sample, "fit": fit})


def _checked_rig(file: _File, copy: Path | None) -> Rig | None:
    """Return the rig with the geometry that its file names; None, with mistakes added, if invalid.

    Of the camera's values that a geometry gives, those that the file leaves out are filled in.
    """
    named, measured = file.marked.get(("geometry",)), None
    if isinstance(named, str) and named and ("geometry",) not in file.marked.refused:
        try:
            path = file.path.parent / named
            measured = read_geometry_file(path) if copy is None else read_geometry_text(copy)
        except InputError as error:
            file.add(("geometry",), error.problems[0])
            return None
        camera = file.marked.data.get("camera")
        if isinstance(camera, dict):
            for key in CAMERA_KEYS:
                camera.setdefault(key, getattr(measured, key))
    rig = file.check(Rig)
    if rig is None or measured is None:
        return rig
    for text in _contradictions(rig, measured):
        file.add(("geometry",), f"{named}: {text}")
    return rig.with_geometry(replace(measured, arrays={}))  # a scan has no use for the corners


def _contradictions(rig: Rig, measured: GeometryCalibration) -> Iterator[str]:
    """Yield why a calibration of the geometry cannot be that of a rig."""
    camera, axis = rig.camera, rig.axes.theta_r
    if measured.size_px != (camera.width_px, camera.height_px):
        width, height = measured.size_px
        yield (
            f"of a camera with {width} x {height} pixels; allowed: {camera.width_px} x "
            f"{camera.height_px}"
        )
    if not abs(measured.distortion) <= _MOST_DISTORTION:
        yield (
            f"distortion {100 * measured.distortion:g} %; allowed: up to "
            f"{100 * _MOST_DISTORTION:g} %. Calibrate again"
        )
    if measured.sign != axis.sign:
        yield f"of theta_r with sign {measured.sign}; allowed: {axis.sign}. Calibrate again"
    elif abs(measured.zero_deg - axis.zero_deg) > _MOST_ZERO_DEG:
        yield (
            f"theta_r reads {measured.zero_deg:.6g} at 0; allowed: up to {_MOST_ZERO_DEG:g} deg "
            f"from its zero_deg, {axis.zero_deg:g}. Was the stage mounted anew? Calibrate again"
        )


def _with_calibration(file: _File, rig: Rig, copy: Path | None) -> Rig:
    """Return the rig with the calibration of its camera; a mistake is added if it is unusable."""
    camera = rig.camera
    if camera.calibration is None:
        return rig
    try:
        named = file.path.parent / camera.calibration
        measured = read_camera_file(named) if copy is None else read_camera_header(copy)
    except InputError as error:
        file.add(("camera", "calibration"), error.problems[0])
        return rig
    if measured.max_dn != camera.max_dn:
        text = f"of a camera with counts to {measured.max_dn:g}; allowed: to {camera.max_dn}"
        file.add(("camera", "calibration"), f"{camera.calibration}: {text}")
    measured = replace(measured, arrays={})  # a scan has no use for the pixel maps
    return rig.model_copy(update={"camera": camera.with_measured(measured)})


def _report(*files: _File) -> list[str]:
    """Return the mistakes of all files, each once, ordered by file and position."""
    lines = []
    for file in sorted(files, key=lambda f: f.name):
        found = sorted(set(file.found), key=lambda item: (item[0], item[1]))
        lines += [f"{file.name}:{m.line}:{m.column}: {text}" for m, text in found[:MAX_REPORTED]]
        if len(found) > MAX_REPORTED:
            mark = found[MAX_REPORTED][0]
            more = f"{len(found) - MAX_REPORTED} more mistakes from here on"
            lines.append(f"{file.name}:{mark.line}:{mark.column}: {more}")
    return lines


@dataclass(slots=True)
class _File:
    """Configuration file under check, with the mistakes found so far."""

    path: Path
    marked: MarkedYaml
    found: list[tuple[Mark, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for mistake in self.marked.mistakes:
            self.add(mistake.path, mistake.text, mistake.mark)

    @property
    def name(self) -> str:
        return printable(str(self.path))

    def add(self, path: KeyPath, text: str, mark: Mark | None = None) -> None:
        """Add a mistake; by default at the value, or at the block that lacks it."""
        where = f"{dotted(path)}: " if path else ""
        self.found.append((mark or self.marked.mark(path), where + text))

    def check(self, model: type[AnySection]) -> AnySection | None:
        """Return the file as a model, or None, with the mistakes added, if it is not valid."""
        if not self.marked.readable:
            return None
        try:
            return model.model_validate(self.marked.data)
        except ValidationError as error:
            for mistake in Explanation(error, model, self.marked).found:
                self.add(*mistake)
            return None
