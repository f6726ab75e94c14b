"""Protocol file: the sample, the geometries to measure, references and fit.

pydantic models; `instrument.config.load` reads them from YAML, and `protocol_checks` compares
values of a protocol with one another and with its rig.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
from pydantic import Discriminator, Field, PrivateAttr, Tag

from instrument.calibration.tile_table import TileTable
from instrument.config.section import Name, NotNegative, Positive, Section
from instrument.config.simulated.sample import SimulatedSample
from instrument.geometry import FloatArray

SweepKey = Literal["theta_i_deg", "dphi_deg", "theta_r_deg"]
Degrees = Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False)]


SampleSize = Annotated[float, Field(gt=0, le=500)]


class Sample(Section):
    """Flat sample on the stage.

    `outline`: a thin rectangle, whose edges in the picture are compared with the pose of the rig;
    none for a sample that is round, irregular or so thick that its sides show.
    """

    name: Name
    width_mm: SampleSize
    height_mm: SampleSize
    outline: Literal["rectangle", "none"] = "rectangle"


MOST_ANGLES = 100_000


class Steps(Section):
    """Evenly spaced angles from `start` to `stop`, both included.

    `num`: how many. `step`: degrees from one to the next, positive also where `stop` is smaller.
    One of the two is given.
    """

    start: Degrees
    stop: Degrees
    num: Annotated[int, Field(ge=1, le=MOST_ANGLES)] | None = None
    step: Annotated[float, Field(gt=0, le=720)] | None = None

    @property
    def count(self) -> int:
        """Number of angles; 0 where neither `num` nor `step` is given."""
        if self.num is not None or self.step is None:
            return self.num or 0
        return round(self._intervals()) + 1

    def _intervals(self) -> float:
        return abs(self.stop - self.start) / (self.step or math.nan)

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Require one of `num` and `step`, which lays angles on both ends."""
        if self.num is None and self.step is None:
            yield "num", f"is missing; allowed: a whole number from 1 to {MOST_ANGLES}, or `step`"
        elif self.num is not None and self.step is not None:
            yield "step", f"{self.step:g} beside num {self.num}; allowed: one of the two"
        elif self.step is not None:
            yield from self._wrong_step(self.step)
        elif self.num == 1 and self.start != self.stop:
            yield "num", f"1; allowed: 2 or more from {self.start:g} to {self.stop:g}"
        elif self.num != 1 and self.start == self.stop:
            yield "num", f"{self.num}; allowed: 1, as start = stop = {self.start:g}"

    def _wrong_step(self, step: float) -> Iterator[tuple[str, str]]:
        count, span_deg = self.count, abs(self.stop - self.start)
        if count > MOST_ANGLES:
            yield "step", f"{step:g} gives {count} angles; allowed: at most {MOST_ANGLES}"
        elif span_deg == 0 or abs(self._intervals() - (count - 1)) > 1e-6:
            parts = max(count - 1, 1)
            fitting = f", such as {span_deg / parts:.6g} or num: {parts + 1}" if span_deg else ""
            yield (
                "step",
                f"{step:g} does not lead from {self.start:g} to {self.stop:g}; allowed: a part of "
                f"their distance of {span_deg:g}{fitting}",
            )


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
        return np.linspace(angles.start, angles.stop, angles.count)
    return np.asarray(angles, dtype=np.float64)


class PatchConfig(Section):
    """Measured patch of the sample, centred on the rotation axis."""

    width_mm: Positive
    height_mm: Positive
    min_pixels: Annotated[int, Field(ge=1, le=100_000_000)] = 100


_MOST_MARKERS = 50  # in the dictionary
_Mm = Annotated[float, Field(ge=-500, le=500, allow_inf_nan=False)]


class Markers(Section):
    """Markers beside the sample, on the plate that carries it: the window follows the plate.

    They are those of OpenCV's dictionary DICT_4X4_50, upright at theta_r = 0, with white around
    them. `size_mm`: side of the black square. `centres_mm`: x and y of the middle of marker 0, 1
    and so on, from the middle of the sample.
    """

    size_mm: Annotated[float, Field(ge=1, le=100)]
    centres_mm: Annotated[
        list[Annotated[list[_Mm], Field(min_length=2, max_length=2)]],
        Field(min_length=1, max_length=_MOST_MARKERS),
    ]


# At 90 degrees the sample is neither visible nor lit.
ViewAngle = Annotated[float, Field(ge=-89.5, le=89.5)]


Certificate = Literal["lambertian", "8/hemispherical", "0/45", "45/0"]
TILE_NUMBER = ("reflectance", "u_reflectance")


class WhiteTile(Section):
    """Reference diffuser of known reflectance, measured at every position of the lamp.

    Either `reflectance` and `u_reflectance`, one number, or `table`: file of its radiance factor at
    angles, beside the protocol. `certificate`: geometry of the one number, incidence/view in
    degrees; away from it the tile departs from the number, and its u grows. Left out, or
    `lambertian`: the number holds everywhere.

    `width_mm` and `height_mm` of a thin rectangular tile: its edges in the picture are compared
    with the pose of the rig. Without them they are not. `again_at_end`: the tile is read once more
    after the points of each setting of the lamp by hand, which must agree; one more swap for each.
    """

    reflectance: Annotated[float, Field(gt=0, le=2)] | None = None
    u_reflectance: NotNegative | None = None
    table: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    certificate: Certificate | None = None
    theta_r_deg: ViewAngle = 0.0
    frames: Annotated[int, Field(ge=1, le=10_000)] = 16
    width_mm: SampleSize | None = None
    height_mm: SampleSize | None = None
    again_at_end: bool = False
    _values: TileTable | None = PrivateAttr(None)

    @property
    def values(self) -> TileTable | None:
        """Content of `table`, None where one number is given."""
        return self._values

    def with_values(self, values: TileTable) -> WhiteTile:
        """Return a copy that holds the content of its `table`."""
        tile = self.model_copy()
        tile._values = values
        return tile

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Require both sizes or none, and one number or a table."""
        if (self.width_mm is None) != (self.height_mm is None):
            missing = "width_mm" if self.width_mm is None else "height_mm"
            yield missing, "is missing; allowed: width_mm and height_mm, or neither"
        if self.table is not None:
            for key in (*TILE_NUMBER, "certificate"):
                if getattr(self, key) is not None:
                    yield key, f"{getattr(self, key)} beside a table; allowed: one of the two"
        elif self.reflectance is None or self.u_reflectance is None:
            for key in TILE_NUMBER:
                if getattr(self, key) is None:
                    yield key, "is missing; allowed: a number, or a table"
        else:
            yield from self._wrong_number(self.reflectance, self.u_reflectance)

    def _wrong_number(self, reflectance: float, u: float) -> Iterator[tuple[str, str]]:
        """Refuse half the reflectance as u: probably in %; and more light than falls on it."""
        if u >= reflectance / 2:
            yield (
                "u_reflectance",
                f"{u:g}; allowed: less than half of reflectance {reflectance:g} (k = 1, absolute "
                "and not in %)",
            )
        if reflectance > 1 and self.certificate not in ("0/45", "45/0"):
            yield (
                "reflectance",
                f"{reflectance:g}; allowed: at most 1 (0/45 or 45/0: 2)",
            )


class DriftCheck(Section):
    """Geometry of the sample that is measured repeatedly to follow the lamp's drift."""

    theta_r_deg: ViewAngle = 0.0
    every_points: Annotated[int, Field(ge=1, le=1_000_000)] = 25


class References(Section):
    """References of the scan; without a white tile the radiance stays relative."""

    white_tile: WhiteTile | None = None
    drift_check: DriftCheck | None = None


class FlyConfig(Section):
    """Steady turning of theta_r, for `motion: fly`.

    The axis turns so slowly that the peak of a Gaussian lobe whose full width at half maximum is
    `narrowest_lobe_deg` is lowered by no more than `u_blur` of its height: see
    `acquisition.plan.flight`.
    """

    narrowest_lobe_deg: Annotated[float, Field(ge=0.1, le=180)] = 10.0
    u_blur: Annotated[float, Field(ge=1e-6, le=0.1)] = 0.002


class MapsConfig(Section):
    """Light of each cell of the sample, kept of each point for `gonio map`.

    `cell_mm`: side of a cell; at least a pixel seen along the normal.
    """

    cell_mm: Annotated[float, Field(gt=0, le=250)] = 0.5


class FitConfig(Section):
    """Models to fit; by default all models of the ladder.

    `method` of computing a rough surface; auto: the cheapest that is accurate enough for the data.
    `scale`: that of the white tile's certificate, or as far as the model's form corrects it.
    """

    models: Annotated[list[Name], Field(min_length=1)] | None = None
    method: Literal["auto", "qualitative", "functional", "exact"] = "auto"
    scale: Literal["model", "certificate"] = "model"

    @property
    def certificate_leads(self) -> bool:
        """True if the model's form does not correct the scale."""
        return self.scale == "certificate"

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Refuse a method beside `models`, whose names already state it."""
        if self.models is not None and self.method != "auto":
            yield (
                "method",
                f"{self.method}; allowed: auto, as `models` names the methods",
            )


# Into a cell of a table: a spreadsheet takes a text that begins with = + - @ for a formula.
Note = Annotated[
    str,
    Field(
        min_length=1,
        max_length=1000,
        pattern=r"^[^=+\-@\s\x00-\x1f\x7f][^\x00-\x1f\x7f]*\n?$",
        description="text of 1 to 1000 characters in one line, not beginning with = + - @",
    ),
]


class Metadata(Section):
    """Facts that an archive needs and no calculation uses; all may be left out.

    They are copied into the record, the report and measurements.csv under these names.
    """

    sample_id: Note | None = None
    operator: Note | None = None
    wavelength_nm: Annotated[float, Field(ge=100, le=100_000)] | None = None
    filter: Note | None = None
    polarisation: Note | None = None
    notes: Note | None = None

    def given(self) -> dict[str, str]:
        """Return the facts that are given, as texts by name."""
        facts = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: _in_text(fact) for name, fact in facts.items() if fact is not None}


def _in_text(fact: str | float) -> str:
    return fact.strip() if isinstance(fact, str) else f"{fact:.10g}"


class GoalConfig(Section):
    """Standard uncertainty `u` that a parameter is wanted with, in its unit."""

    u: Positive


class Protocol(Section):
    """Complete protocol file.

    `goal`: u wanted of parameters, by name; the scan then chooses among the geometries of the
    sweeps, and those between them, until it is reached, or `budget_min` minutes are spent.
    `polariser_deg`: axis of a polariser before the camera, from the plane of incidence.
    """

    name: Name
    description: str = ""
    rig: Annotated[str, Field(min_length=1, max_length=1000)]
    sample: Sample
    sweeps: Annotated[list[SweepConfig], Field(min_length=1)]
    window: PatchConfig
    markers: Markers | None = None
    polariser_deg: Annotated[float, Field(ge=0, le=90)] | None = None
    frames_per_point: Annotated[int, Field(ge=1, le=10_000)] = 4
    dark_frames: Annotated[int, Field(ge=1, le=10_000)] = 8
    exposure_target: Annotated[float, Field(gt=0, lt=1)] = 0.7
    keep_frames: bool = False
    maps: MapsConfig | None = None
    motion: Literal["stepped", "fly"] = "stepped"
    fly: FlyConfig = FlyConfig()
    references: References = References()
    fit: FitConfig = FitConfig()
    simulated_sample: SimulatedSample | None = None
    metadata: Metadata = Metadata()
    goal: Annotated[dict[str, GoalConfig], Field(min_length=1)] | None = None
    budget_min: Positive | None = None

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Refuse a budget without a goal, and a goal of a scan that does not stop."""
        if self.goal is not None and self.motion == "fly":
            yield "motion", "fly beside a goal; allowed: stepped, as it chooses single points"
        if self.budget_min is not None and self.goal is None:
            yield "budget_min", f"{self.budget_min:g} without a goal; allowed: beside goal"
