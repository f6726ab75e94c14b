"""Files of a map: NumPy's .npz, and NeXus for those who have h5py."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.sample_maps.sample_map import UNITS, SampleMap
from instrument.errors import InputError
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    import h5py

_HDF5_UNITS = {"": "", "°": "deg"}


def npz_bytes(found: SampleMap) -> bytes:
    """Return the content of a .npz file: each map as 32-bit floats, places, and facts as text."""
    file = io.BytesIO()
    content: dict[str, Any] = {**_maps(found), "x_mm": found.x_mm, "y_mm": found.y_mm}
    content |= {"model": found.model, "sample": found.sample, "title": found.title}
    np.savez(file, **content)
    return file.getvalue()


def require_nexus() -> None:
    """Raise `InputError` where the library h5py is not installed."""
    try:
        import h5py  # noqa: F401 - whether it can be imported
    except ImportError as error:
        raise InputError(
            "--nexus needs h5py, which this Python does not have: pip install 'gonio[nexus]'"
        ) from error


def nexus_bytes(found: SampleMap) -> bytes:
    """Return the content of a NeXus file: an NXdata for each parameter, with its u as errors.

    Raises `InputError` where the library h5py is not installed.
    """
    require_nexus()
    import h5py

    with h5py.File("map.nxs", "w", driver="core", backing_store=False) as file:
        file.attrs.update({"NX_class": "NXroot", "default": "entry", "creator": "gonio"})
        _write_entry(file, found)
        file.flush()
        return bytes(file.id.get_file_image())


def _maps(found: SampleMap) -> dict[str, FloatArray]:
    maps = {"chi2": found.chi2, "count": found.count, "rejected": found.rejected}
    for name, values in found.values.items():
        maps |= {
            name: values,
            f"u_{name}": found.u(name),
            f"u_own_{name}": found.u_own[name],
        }
    return {name: np.asarray(values, dtype=np.float32) for name, values in maps.items()}


def _write_entry(file: h5py.File, found: SampleMap) -> None:
    entry = _group(file, "entry", "NXentry")
    for name, text in (("title", found.title), ("program_name", "gonio"), ("model", found.model)):
        entry[name] = text
    _group(entry, "sample", "NXsample")["name"] = found.sample
    entry.attrs["default"] = "sigma_deg"
    for name, values in found.values.items():
        data = _axes(_group(entry, name, "NXdata"), found)
        data.attrs["signal"] = name
        unit = _HDF5_UNITS[UNITS[name]]
        for key, own in ((name, values), (f"{name}_errors", found.u(name))):
            data[key] = own.astype(np.float32)
            data[key].attrs["units"] = unit
    data = _axes(_group(entry, "chi2", "NXdata"), found)
    data.attrs["signal"] = "chi2"
    data["chi2"], data["geometries"] = found.chi2, np.nan_to_num(found.count).astype(np.int32)


def _axes(data: h5py.Group, found: SampleMap) -> h5py.Group:
    data.attrs["axes"] = ["y", "x"]
    for name, places in (("x", found.x_mm), ("y", found.y_mm)):
        data[name] = places
        data[name].attrs["units"] = "mm"
    return data


def _group(parent: h5py.Group, name: str, kind: str) -> h5py.Group:
    group = parent.create_group(name)
    group.attrs["NX_class"] = kind
    return group
