"""NeXus: an HDF5 file in the groups of the NeXus standard, which NeXpy and h5web plot on opening.

Layout: manual of the NeXus International Advisory Committee, classes NXroot, NXentry, NXdata,
NXdetector, NXsource and NXparameters. The standard has no definition for BRDF, so none is named.
Azimuth: the program's own, stated in the file as attributes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.data.measurements import Measurements
from analysis.data.sweeps import Sweep, signed_view, sweeps
from analysis.exchange.exported import BrdfTable, Export, ExportedModel, one_line
from analysis.models import MODELS
from instrument.errors import InputError
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    import h5py

Attributes = Mapping[str, str | list[str] | int]

MEASURED = {"origin": "measured"}
MODELLED = {"origin": "modelled"}
_AZIMUTH = "dphi = phi_r - phi_i: 0 deg on the side of the source, 180 deg on the mirror side"
_SCALED = (
    "modelled curve of relative values, scaled to them at each theta_i: the shape alone counts"
)


def files(export: Export, stem: str) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the content of the one file.

    Raises `InputError` where the library h5py is not installed.
    """
    try:
        import h5py
    except ImportError as error:
        raise InputError(
            "--format nexus needs h5py, which this Python does not have: pip install 'gonio[nexus]'"
        ) from error
    with h5py.File(f"{stem}.nxs", "w", driver="core", backing_store=False) as file:
        file.attrs.update({"NX_class": "NXroot", "default": "entry", "creator": "gonio"})
        _write_entry(file, export)
        file.flush()
        content = file.id.get_file_image()
    yield f"{stem}.nxs", content


def _write_entry(file: h5py.File, export: Export) -> None:
    entry = _group(file, "entry", "NXentry")
    _texts(entry, {"title": export.sample, "program_name": "gonio"})
    times = export.facts.get("measured_utc", "").split(" to ")
    if len(times) == 2:
        _texts(entry, {"start_time": times[0], "end_time": times[1]})
    _texts(_group(entry, "sample", "NXsample"), {"name": export.sample})
    _write_instrument(entry, export)
    _texts(_group(entry, "facts", "NXcollection"), export.facts)
    if export.model is not None:
        _write_model(entry, export.model)
    _write_points(entry, export)
    found = _sweeps(export.table)
    for number, sweep in enumerate(found, start=1):
        _write_sweep(entry, f"sweep_{number}", sweep, export)
    entry.attrs["default"] = "sweep_1" if found else "points"


def _write_instrument(entry: h5py.Group, export: Export) -> None:
    instrument = _group(entry, "instrument", "NXinstrument")
    _texts(instrument, {"name": export.facts.get("rig", "gonioreflectometer")})
    parts = (
        ("source", "NXsource", export.table.source_sr),
        ("detector", "NXdetector", export.table.receiver_sr),
    )
    for name, kind, solid_angle in parts:
        part = _group(instrument, name, kind)
        if solid_angle is not None:
            _write(part, "solid_angle", np.float64(solid_angle), {"units": "sr"})


def _write_model(entry: h5py.Group, model: ExportedModel) -> None:
    group = _group(entry, "model", "NXparameters")
    group.attrs.update(MODELLED)
    _texts(group, {"name": model.name, "verdict": model.verdict})
    units = {p.name: p.unit for p in MODELS[model.name].parameters}
    for name, value in model.values.items():
        unit = {"units": units.get(name, "")}
        _write(group, name, np.float64(value), {**unit, **MODELLED})
        u = model.u.get(name)
        _write(group, f"{name}_errors", np.float64(np.nan if u is None else u), unit)


def _write_points(entry: h5py.Group, export: Export) -> None:
    """All points in the order measured."""
    every = np.arange(export.table.size)
    group = _data(entry, "points", "point", "all points in the order measured")
    _write(group, "point", every + 1, {})
    _write_values(group, every, export)


def _write_sweep(entry: h5py.Group, name: str, sweep: Sweep, export: Export) -> None:
    theta_i, plane = f"{sweep.theta_i_deg:g} deg", f"{sweep.dphi_deg:g}/{sweep.dphi_deg + 180:g}"
    group = _data(entry, name, "theta_r_signed", f"theta_i = {theta_i}, plane dphi = {plane} deg")
    view = signed_view(_measurements(export.table))[sweep.points]
    side = f"positive at dphi = {sweep.dphi_deg:g} deg, negative opposite"
    _write(group, "theta_r_signed", view, {"units": "deg", "direction": side})
    _write_values(group, sweep.points, export)


def _data(entry: h5py.Group, name: str, axis: str, title: str) -> h5py.Group:
    group = _group(entry, name, "NXdata")
    group.attrs.update({"signal": "brdf", "axes": [axis]})
    group.attrs.update({f"{angle}_indices": [0] for angle in (axis, "theta_i", "theta_r", "dphi")})
    _texts(group, {"title": title})
    return group


def _write_values(group: h5py.Group, points: Any, export: Export) -> None:
    """Angles, BRDF with its u, and the curve of the model if there is one."""
    table = export.table
    angles = {
        "theta_i": table.geometry.theta_i_deg,
        "theta_r": table.geometry.theta_r_deg,
        "dphi": table.geometry.dphi_deg,
    }
    for name, angle in angles.items():
        convention = {"convention": _AZIMUTH} if name == "dphi" else {}
        _write(group, name, angle[points], {"units": "deg", **convention})
    kind: Attributes = (
        {"units": "arbitrary", "long_name": "relative BRDF (unit of its own)", "relative": 1}
        if table.relative
        else {"units": "1/sr", "long_name": "BRDF (1/sr)", "relative": 0}
    )
    _write(group, "brdf", table.brdf[points], {**kind, **MEASURED})
    if not np.all(np.isnan(table.u_brdf)):
        u_name = "standard uncertainty (k = 1), NaN where it is not known"
        u_kind = {**kind, "long_name": u_name}
        _write(group, "brdf_errors", table.u_brdf[points], u_kind)
    if export.model is not None:
        group.attrs["auxiliary_signals"] = ["modelled_brdf"]
        curve = _curve(export.model, table)[points]
        note = {"note": _SCALED} if table.relative else {}
        long_name = f"modelled by {export.model.name}"
        _write(group, "modelled_brdf", curve, {**kind, **MODELLED, **note, "long_name": long_name})


def _curve(model: ExportedModel, table: BrdfTable) -> FloatArray:
    """BRDF of the model at the points (N,); for relative values at their level."""
    curve = model.brdf(table.geometry)
    if not table.relative:
        return curve
    _, lamp = np.unique(table.geometry.theta_i_deg, return_inverse=True)
    seen, power = (np.bincount(lamp, curve * values) for values in (table.brdf, curve))
    level = np.divide(seen, power, out=np.ones_like(seen), where=power > 0)
    return np.asarray(curve * level[lamp])


def _measurements(table: BrdfTable) -> Measurements:
    g = table.geometry
    return Measurements.bare(g.theta_i_deg, g.theta_r_deg, g.dphi_deg, table.brdf)


def _sweeps(table: BrdfTable) -> tuple[Sweep, ...]:
    return sweeps(_measurements(table))


def _group(parent: h5py.Group, name: str, kind: str) -> h5py.Group:
    group = parent.create_group(name)
    group.attrs["NX_class"] = kind
    return group


def _write(group: h5py.Group, name: str, value: Any, attributes: Attributes) -> None:
    group.create_dataset(name, data=value).attrs.update(attributes)


def _texts(group: h5py.Group, texts: Mapping[str, str]) -> None:
    """Each text as a field of its own, under a name that NeXus allows."""
    for name, text in texts.items():
        _write(group, re.sub(r"\W", "_", name, flags=re.ASCII) or "_", one_line(text), {})
