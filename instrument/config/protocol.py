"""Protocol file: the sample, the geometries to measure, references and fit.

pydantic models, and the checks across values of a protocol and against its rig;
`instrument.config.load` reads them from YAML.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import product
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, TypeAdapter, ValidationError

from instrument.config.axes import AXES, EMULATED, Axis
from instrument.config.section import Finite, Name, NotNegative, Positive, Section
from instrument.config.yaml_positions import KeyPath, MarkedYaml
from instrument.geometry import FloatArray

SweepKey = Literal["theta_i_deg", "dphi_deg", "theta_r_deg"]
Degrees = Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False)]


SampleSize = Annotated[float, Field(gt=0, le=500)]


class Sample(Section):
    """Flat sample on the stage."""

    name: Name
    width_mm: SampleSize
    height_mm: SampleSize


class Steps(Section):
    """Evenly spaced angles: `num` values from `start` to `stop`, both included."""

    start: Degrees
    stop: Degrees
    num: Annotated[int, Field(ge=1, le=100_000)]

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Require start == stop for num = 1, and start != stop for more."""
        if self.num == 1 and self.start != self.stop:
            yield "num", f"1; allowed: 2 or more from {self.start:g} to {self.stop:g}"
        if self.num > 1 and self.start == self.stop:
            yield "num", f"{self.num}; allowed: 1, as start = stop = {self.start:g}"


FORMS_OF_ANGLES = ("<list>", "<steps>")  # no key has such a name


def _form_of_angles(angles: object) -> str | None:
    if isinstance(angles, list):
        return "<list>"
    return "<steps>" if isinstance(angles, dict | Steps) else None


AngleList = Annotated[list[Degrees], Field(min_length=1)]
# Discriminated by the form in the file, so that a mistake is reported for that form only.
Angles = Annotated[
    Annotated[AngleList, Tag("<list>")] | Annotated[Steps, Tag("<steps>")],
    Discriminator(_form_of_angles),
]
SweepConfig = Annotated[dict[SweepKey, Angles], Field(min_length=3)]


def angles_deg(angles: list[float] | Steps) -> FloatArray:
    """Return the angles (N,) of one axis of a sweep in degrees, in the order of the file."""
    if isinstance(angles, Steps):
        return np.linspace(angles.start, angles.stop, angles.num)
    return np.asarray(angles, dtype=np.float64)


class PatchConfig(Section):
    """Measured patch of the sample, centred on the rotation axis."""

    width_mm: Positive
    height_mm: Positive
    min_pixels: Annotated[int, Field(ge=1, le=100_000_000)] = 100


# At 90 degrees the sample is neither visible nor lit.
ViewAngle = Annotated[float, Field(ge=-89.5, le=89.5)]


class WhiteTile(Section):
    """Reference diffuser of known reflectance, measured at every position of the lamp."""

    reflectance: Annotated[float, Field(gt=0, le=1)]
    u_reflectance: NotNegative
    theta_r_deg: ViewAngle = 0.0
    frames: Annotated[int, Field(ge=1, le=10_000)] = 16

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Refuse an uncertainty of half the reflectance or more: it was probably given in %."""
        if self.u_reflectance >= self.reflectance / 2:
            yield (
                "u_reflectance",
                f"{self.u_reflectance:g}; allowed: less than half of reflectance "
                f"{self.reflectance:g} (k = 1, absolute and not in %)",
            )


class DriftCheck(Section):
    """Geometry of the sample that is measured repeatedly to follow the lamp's drift."""

    theta_r_deg: ViewAngle = 0.0
    every_points: Annotated[int, Field(ge=1, le=1_000_000)] = 25


class References(Section):
    """References of the scan; without a white tile the radiance stays relative."""

    white_tile: WhiteTile | None = None
    drift_check: DriftCheck | None = None


class FitConfig(Section):
    """Models to fit; by default all models of the ladder.

    `method` of computing a rough surface; auto: the cheapest that is accurate enough for the data.
    """

    models: Annotated[list[Name], Field(min_length=1)] | None = None
    method: Literal["auto", "qualitative", "functional", "exact"] = "auto"

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Refuse a method beside `models`, whose names already state it."""
        if self.models is not None and self.method != "auto":
            yield (
                "method",
                f"{self.method}; allowed: auto, as `models` names the methods",
            )


class SimulatedSample(Section):
    """True reflectance of the sample on a simulated rig; real rigs and the fit ignore it.

    `method` of computing its reflectance; auto: the cheapest that is accurate enough for the image.
    `mottling`: relative standard deviation of the albedo over the surface, in patches of
    `mottling_size_mm`.
    """

    model: Name
    parameters: dict[str, Finite]
    method: Literal["auto", "exact"] = "auto"
    mottling: Annotated[float, Field(ge=0, le=0.3)] = 0.0
    mottling_size_mm: Annotated[float, Field(ge=0.2, le=1000)] = 2.0


class Protocol(Section):
    """Complete protocol file."""

    name: Name
    description: str = ""
    rig: Annotated[str, Field(min_length=1, max_length=1000)]
    sample: Sample
    sweeps: Annotated[list[SweepConfig], Field(min_length=1)]
    window: PatchConfig
    frames_per_point: Annotated[int, Field(ge=1, le=10_000)] = 4
    dark_frames: Annotated[int, Field(ge=1, le=10_000)] = 8
    exposure_target: Annotated[float, Field(gt=0, lt=1)] = 0.7
    keep_frames: bool = False
    references: References = References()
    fit: FitConfig = FitConfig()
    simulated_sample: SimulatedSample | None = None


MAX_GEOMETRIES = 1_000_000  # at one a second, eleven days

ModelCheck = Callable[[str, dict[str, float] | None], str | None]
Mistakes = Iterator[tuple[KeyPath, str]]

_MODELS: KeyPath = ("fit", "models")
_GEOMETRY_DEG = {"theta_i": (0.0, 89.5), "theta_r": (-89.5, 89.5)}
_DEGREES: TypeAdapter[Any] = TypeAdapter(Degrees)
_ANGLES: TypeAdapter[Any] = TypeAdapter(Angles)
_AXIS: TypeAdapter[Any] = TypeAdapter(Axis)
_POSITIVE: TypeAdapter[Any] = TypeAdapter(Positive)
_NAME: TypeAdapter[Any] = TypeAdapter(Name)
_PARAMETERS: TypeAdapter[Any] = TypeAdapter(dict[str, Finite])


def rig_mistakes(protocol: MarkedYaml, rig: MarkedYaml, rig_name: str) -> Mistakes:
    """Yield what the rig cannot do of the protocol: path in the protocol, and message.

    Values that are valid by themselves are checked even if others in the files are not.
    """
    for axis in AXES:
        limits = _sound(_AXIS, rig, "axes", axis)
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
    scene = rig.get(("camera", "driver")) == "simulated" or (
        rig.get(("camera", "device")) == EMULATED
    )
    if scene and protocol.get(("simulated_sample",)) is None:
        text = f"is missing; the rig {rig_name} is simulated and needs a sample to render"
        yield ("simulated_sample",), text


def own_mistakes(protocol: MarkedYaml, check_model: ModelCheck | None) -> Mistakes:
    """Yield the values of a protocol that contradict one another: path and message.

    `check_model(name, parameters or None)` returns what is wrong with a model, or None.
    """
    for axis, (low, high) in _GEOMETRY_DEG.items():
        for path, value in _written_angles(protocol, axis):
            # The models already limit the angles of the references.
            if path[0] == "sweeps" and _impossible(axis, value):
                yield path, f"{value:g} deg; allowed: {low:g} to {high:g} deg from the normal"
    for key in ("width_mm", "height_mm"):
        window = _sound(_POSITIVE, protocol, "window", key)
        sample = _sound(_POSITIVE, protocol, "sample", key)
        if window is not None and sample is not None and window > sample:
            text = f"{window:g} mm is larger than the sample; allowed: at most {sample:g} mm"
            yield ("window", key), text
    yield from _repeated(protocol)
    if check_model is not None:
        yield from _model_mistakes(protocol, check_model)


def _sound(kind: TypeAdapter[Any], marked: MarkedYaml, *path: str | int) -> Any:
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
        value = _sound(_DEGREES, protocol, *path)
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
            value = _sound(_DEGREES, protocol, *path) if "theta_r_deg" in block else default
            if value is not None:
                yield path, value


def _window_past_picture(protocol: MarkedYaml, rig: MarkedYaml, rig_name: str) -> Mistakes:
    width, columns, rows = (
        _sound(_POSITIVE, rig, "camera", key) for key in ("field_width_mm", "width_px", "height_px")
    )
    if width is None:
        return
    field_mm = {"width_mm": width}
    if columns is not None and rows is not None:
        field_mm["height_mm"] = width * rows / columns
    for key, size in field_mm.items():
        window = _sound(_POSITIVE, protocol, "window", key)
        if window is not None and window > size:
            place = f"{rig_name}:{rig.mark(('camera', 'field_width_mm')).line}"
            text = f"{window:g} mm is larger than the camera's field; allowed: at most {size:g} mm"
            yield ("window", key), f"{text} ({place})"


def _repeated(protocol: MarkedYaml) -> Mistakes:
    """Yield angles that a sweep repeats, and geometries that two sweeps share."""
    sweeps: dict[int, list[list[float] | Steps]] = {}
    for sweep in range(_items(protocol.get(("sweeps",)))):
        paths: list[KeyPath] = [("sweeps", sweep, f"{axis}_deg") for axis in AXES]
        axes = [_sound(_ANGLES, protocol, *path) for path in paths]
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
    return angles.num if isinstance(angles, Steps) else len(angles)


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


def _model_mistakes(protocol: MarkedYaml, check_model: ModelCheck) -> Mistakes:
    paths: list[KeyPath] = [(*_MODELS, k) for k in range(_items(protocol.get(_MODELS)))]
    for path in (*paths, ("simulated_sample", "model")):
        name = _sound(_NAME, protocol, *path)
        text = None if name is None else check_model(name, None)
        if text is not None:
            yield path, text
        elif name is not None and path not in paths:
            at: KeyPath = ("simulated_sample", "parameters")
            parameters = _sound(_PARAMETERS, protocol, *at)
            text = None if parameters is None else check_model(name, parameters)
            if text is not None:
                yield at, text
