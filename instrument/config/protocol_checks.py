"""Checks of a protocol across its values and against its rig, in files that may hold mistakes.

Values that are valid by themselves are checked even if others in the files are not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from instrument.config.axes import AXES, EMULATED, Axis
from instrument.config.camera import DarkPatch
from instrument.config.protocol import (
    Angles,
    Degrees,
    DriftCheck,
    Markers,
    Steps,
    WhiteTile,
    angles_deg,
)
from instrument.config.section import Finite, Name, Positive
from instrument.config.yaml_positions import KeyPath, MarkedYaml

MAX_GEOMETRIES = 1_000_000  # at one a second, eleven days

ModelCheck = Callable[[str, dict[str, float] | None], str | None]
Mistakes = Iterator[tuple[KeyPath, str]]

_MODELS: KeyPath = ("fit", "models")
_LOBE = "fresnel_lobe"  # the model that a polariser's angle changes
_GEOMETRY_DEG = {"theta_i": (0.0, 89.5), "theta_r": (-89.5, 89.5)}
_DEGREES: TypeAdapter[Any] = TypeAdapter(Degrees)
_ANGLES: TypeAdapter[Any] = TypeAdapter(Angles)
_AXIS: TypeAdapter[Any] = TypeAdapter(Axis)
_POSITIVE: TypeAdapter[Any] = TypeAdapter(Positive)
_PATCH: TypeAdapter[Any] = TypeAdapter(DarkPatch)
_MARKERS: TypeAdapter[Any] = TypeAdapter(Markers)
_NUMBER: TypeAdapter[Any] = TypeAdapter(Finite)
_NAME: TypeAdapter[Any] = TypeAdapter(Name)
_PARAMETERS: TypeAdapter[Any] = TypeAdapter(dict[str, Finite])


def rig_mistakes(protocol: MarkedYaml, rig: MarkedYaml, rig_name: str) -> Mistakes:
    """Yield what the rig cannot do of the protocol: path in the protocol, and message."""
    for axis in AXES:
        limits = _valid(_AXIS, rig, "axes", axis)
        if limits is None:
            continue
        place = f"{rig_name}:{rig.mark(('axes', axis)).line}"
        for path, value in _written_angles(protocol, axis):
            if not limits.min_deg <= value <= limits.max_deg and not _impossible(axis, value):
                yield (
                    path,
                    f"{value:g} deg is past the limits of axis {axis}; allowed: "
                    f"{limits.min_deg:g} to {limits.max_deg:g} deg ({place})",
                )
    yield from _window_past_picture(protocol, rig, rig_name)
    yield from _patch_covered(protocol, rig, rig_name)
    scene = rig.get(("camera", "driver")) == "simulated" or (
        rig.get(("camera", "device")) == EMULATED
    )
    if scene:
        yield from _unknown_tile(protocol, rig, rig_name)
    if scene and protocol.get(("simulated_sample",)) is None:
        text = f"is missing; the rig {rig_name} is simulated and needs a sample to render"
        yield ("simulated_sample",), text


def _unknown_tile(protocol: MarkedYaml, rig: MarkedYaml, rig_name: str) -> Mistakes:
    """Yield a tile that a scene cannot show: a certificate is not what the tile is."""
    tile: KeyPath = ("references", "white_tile")
    number = _valid(_POSITIVE, protocol, *tile, "reflectance")
    factor = number is not None and number > 1 and protocol.get((*tile, "certificate")) is not None
    table = protocol.get((*tile, "table")) is not None
    if rig.get(("simulation", "tile")) is None and (table or factor):
        yield (
            (*tile, "table" if table else "reflectance"),
            f"the rig {rig_name} is simulated; allowed: with simulation: tile in it, the true tile",
        )


def own_mistakes(protocol: MarkedYaml, check_model: ModelCheck | None) -> Mistakes:
    """Yield the values of a protocol that contradict one another: path and message.

    `check_model(name, parameters or None)` returns what is wrong with a model, or None.
    """
    for axis, (low, high) in _GEOMETRY_DEG.items():
        for path, value in _written_angles(protocol, axis):
            # The models already limit the angles of the references.
            if path[0] == "sweeps" and _impossible(axis, value):
                yield path, f"{value:g} deg; allowed: {low:g} to {high:g} deg from the normal"
    yield from _window_past_surfaces(protocol)
    yield from _markers_covered(protocol)
    yield from _repeated(protocol)
    if _valid(_NUMBER, protocol, "polariser_deg") is not None:
        yield from _out_of_plane(protocol)
        yield from _without_lobe(protocol)
    if check_model is not None:
        yield from _model_mistakes(protocol, check_model)


def _window_past_surfaces(protocol: MarkedYaml) -> Mistakes:
    surfaces: dict[str, KeyPath] = {
        "sample": ("sample",), "white tile": ("references", "white_tile"),
    }  # fmt: skip
    for key, (name, path) in product(("width_mm", "height_mm"), surfaces.items()):
        window = _valid(_POSITIVE, protocol, "window", key)
        size = _valid(_POSITIVE, protocol, *path, key)
        if window is not None and size is not None and window > size:
            text = f"{window:g} mm is larger than the {name}; allowed: at most {size:g} mm"
            yield ("window", key), text


def _markers_covered(protocol: MarkedYaml) -> Mistakes:
    """Yield markers that the sample covers, in whole or in part."""
    markers = _valid(_MARKERS, protocol, "markers")
    size = [_valid(_POSITIVE, protocol, "sample", key) for key in ("width_mm", "height_mm")]
    if markers is None or None in size:
        return
    for number, centre in enumerate(markers.centres_mm):
        free = [abs(at) - (own + markers.size_mm) / 2 for at, own in zip(centre, size, strict=True)]
        if max(free) < 0:
            yield (
                ("markers", "centres_mm", number),
                f"marker {number} at x {centre[0]:g}, y {centre[1]:g} mm is covered by the sample; "
                f"allowed: beside it, x or y {(size[0] + markers.size_mm) / 2:g} or "
                f"{(size[1] + markers.size_mm) / 2:g} mm or more from its middle",
            )


def _valid(kind: TypeAdapter[Any], marked: MarkedYaml, *path: str | int) -> Any:
    try:
        return kind.validate_python(marked.get(path), strict=True)
    except ValidationError:
        return None


def _impossible(axis: str, value: float) -> bool:
    low, high = _GEOMETRY_DEG.get(axis, (-np.inf, np.inf))
    return not low <= value <= high


def _items(value: object) -> int:
    return len(value) if isinstance(value, list) else 0


def _written_angles(protocol: MarkedYaml, axis: str) -> Iterator[tuple[KeyPath, float]]:
    """Yield path and value of the valid angles in the file: whole lists, and ends of steps."""
    paths: list[KeyPath] = []
    for sweep in range(_items(protocol.get(("sweeps",)))):
        angles: KeyPath = ("sweeps", sweep, f"{axis}_deg")
        ends = [(*angles, "start"), (*angles, "stop")]
        paths += [(*angles, k) for k in range(_items(protocol.get(angles)))] or ends
    for path in paths:
        value = _valid(_DEGREES, protocol, *path)
        if value is not None:
            yield path, value
    if axis == "theta_r":
        yield from _reference_angles(protocol)


def _reference_angles(protocol: MarkedYaml) -> Iterator[tuple[KeyPath, float]]:
    for reference, section in (("white_tile", WhiteTile), ("drift_check", DriftCheck)):
        block = protocol.get(("references", reference))
        if isinstance(block, dict):
            path: KeyPath = ("references", reference, "theta_r_deg")
            default = section.model_fields["theta_r_deg"].default
            value = _valid(_DEGREES, protocol, *path) if "theta_r_deg" in block else default
            if value is not None:
                yield path, value


def _window_past_picture(protocol: MarkedYaml, rig: MarkedYaml, rig_name: str) -> Mistakes:
    width, columns, rows = (
        _valid(_POSITIVE, rig, "camera", key) for key in ("field_width_mm", "width_px", "height_px")
    )
    if width is None:
        return
    field_mm = {"width_mm": width}
    if columns is not None and rows is not None:
        field_mm["height_mm"] = width * rows / columns
    for key, size in field_mm.items():
        window = _valid(_POSITIVE, protocol, "window", key)
        if window is not None and window > size:
            place = f"{rig_name}:{rig.mark(('camera', 'field_width_mm')).line}"
            text = f"{window:g} mm is larger than the camera's field; allowed: at most {size:g} mm"
            yield ("window", key), f"{text} ({place})"


def _patch_covered(protocol: MarkedYaml, rig: MarkedYaml, rig_name: str) -> Mistakes:
    """Yield a sample or tile that lies over the camera's dark patch."""
    patch = _valid(_PATCH, rig, "camera", "dark_patch")
    if patch is None:
        return
    for path in (("sample",), ("references", "white_tile")):
        size = [_valid(_POSITIVE, protocol, *path, key) for key in ("width_mm", "height_mm")]
        if None in size:
            continue
        free = [2 * abs(patch.x_mm) - patch.width_mm, 2 * abs(patch.y_mm) - patch.height_mm]
        if all(own > limit for own, limit in zip(size, free, strict=True)):
            key = "width_mm" if free[0] > free[1] else "height_mm"
            place = f"{rig_name}:{rig.mark(('camera', 'dark_patch')).line}"
            text = f"{max(free):g} mm, or the dark patch is covered ({place})"
            yield (*path, key), f"{size[key == 'height_mm']:g} mm; allowed: at most {text}"


def _repeated(protocol: MarkedYaml) -> Mistakes:
    """Yield angles that a sweep repeats, and geometries that two sweeps share."""
    sweeps: dict[int, list[list[float] | Steps]] = {}
    for sweep in range(_items(protocol.get(("sweeps",)))):
        paths: list[KeyPath] = [("sweeps", sweep, f"{axis}_deg") for axis in AXES]
        axes = [_valid(_ANGLES, protocol, *path) for path in paths]
        for path, angles in zip(paths, axes, strict=True):
            if isinstance(angles, list):
                yield from _twice(path, angles)
        if all(angles is not None for angles in axes):
            sweeps[sweep] = axes
    # Counted before they are expanded: a short file can request more than fits into memory.
    total = sum(math.prod(map(_count, axes)) for axes in sweeps.values())
    if total > MAX_GEOMETRIES:
        yield ("sweeps",), f"{total} geometries; allowed: at most {MAX_GEOMETRIES} in a protocol"
    elif len(sweeps) > 1:
        yield from _shared(sweeps)


def _count(angles: list[float] | Steps) -> int:
    return angles.count if isinstance(angles, Steps) else len(angles)


def _twice(path: KeyPath, angles: list[float]) -> Mistakes:
    first: dict[float, int] = {}
    for k, angle in enumerate(angles):
        earlier = first.setdefault(round(angle, 6), k)
        if earlier != k:
            text = f"{angle:g} deg is already in [{earlier}] of this list; allowed: each once"
            yield (*path, k), text


def _shared(sweeps: dict[int, list[list[float] | Steps]]) -> Mistakes:
    first: dict[tuple[float, ...], int] = {}
    for sweep, axes in sweeps.items():
        shared: dict[int, list[tuple[float, ...]]] = {}
        for geometry in product(*(np.unique(angles_deg(a).round(6)).tolist() for a in axes)):
            earlier = first.setdefault(geometry, sweep)
            if earlier != sweep:
                shared.setdefault(earlier, []).append(geometry)
        for earlier, geometries in shared.items():
            values = zip(AXES, geometries[0], strict=True)
            example = ", ".join(f"{axis} {value:g}" for axis, value in values)
            yield (
                ("sweeps", sweep),
                f"{len(geometries)} of its geometries are already in sweeps[{earlier}], such as "
                f"{example} deg; allowed: each once",
            )


def through_polariser(model: str, angle_deg: float) -> str:
    """Return the name of a model whose lobe a polariser at `angle_deg` shows.

    The angle is that from the plane of incidence. Models without such a lobe keep their name.
    """
    terms = model.split("+")
    return "+".join(f"{_LOBE}@{angle_deg:.10g}" if term == _LOBE else term for term in terms)


def _out_of_plane(protocol: MarkedYaml) -> Mistakes:
    """Yield azimuths at which a polariser's angle from the plane of incidence means nothing."""
    for sweep in range(_items(protocol.get(("sweeps",)))):
        path: KeyPath = ("sweeps", sweep, "dphi_deg")
        angles = _valid(_ANGLES, protocol, *path)
        if angles is None or _count(angles) > MAX_GEOMETRIES:
            continue
        for value in angles_deg(angles)[angles_deg(angles) % 180 != 0][:1]:
            yield (
                path,
                f"{value:g} deg beside polariser_deg; allowed: 0 and 180 deg, where lamp, camera "
                "and normal lie in one plane",
            )


def _without_lobe(protocol: MarkedYaml) -> Mistakes:
    """Yield models that say nothing of a polariser, or another angle of it."""
    models = protocol.get(_MODELS)
    names = [name for name in models if isinstance(name, str)] if isinstance(models, list) else []
    sample: KeyPath = ("simulated_sample", "model")
    simulated = _valid(_NAME, protocol, *sample)
    for path, own in ((_MODELS, names), (sample, [simulated] if simulated else None)):
        if own is not None and not any(_LOBE in name.split("+") for name in own):
            yield (
                path,
                f"without the model {_LOBE} beside polariser_deg; allowed: a sum with it, such as "
                f"oren_nayar+{_LOBE}, or no polariser_deg",
            )
    for name in names:
        if f"{_LOBE}@" in name:
            yield _MODELS, f"{name} beside polariser_deg; allowed: {_LOBE}, which takes its angle"


def _model_mistakes(protocol: MarkedYaml, check_model: ModelCheck) -> Mistakes:
    paths: list[KeyPath] = [(*_MODELS, k) for k in range(_items(protocol.get(_MODELS)))]
    for path in (*paths, ("simulated_sample", "model")):
        name = _valid(_NAME, protocol, *path)
        text = None if name is None else check_model(name, None)
        if text is not None:
            yield path, text
        elif name is not None and path not in paths:
            at: KeyPath = ("simulated_sample", "parameters")
            parameters = _valid(_PARAMETERS, protocol, *at)
            text = None if parameters is None else check_model(name, parameters)
            if text is not None:
                yield at, text
            elif parameters is not None:
                yield from _variation_mistakes(protocol, name, parameters, check_model)


def _variation_mistakes(
    protocol: MarkedYaml, name: str, parameters: dict[str, float], check_model: ModelCheck
) -> Mistakes:
    at: KeyPath = ("simulated_sample", "variation", "parameters")
    other = _valid(_PARAMETERS, protocol, *at)
    text = None if other is None else check_model(name, {**parameters, **other})
    if text is not None:
        yield at, text
