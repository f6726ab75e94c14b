"""Columns of a CSV table of measurements: names, units and allowed values.

Each row needs COLUMNS. The other columns state what a fit must know beyond one u per row, and may
be left out: a run's measurements.csv has them all, a table of any origin may have some.

::

    flags                       a row with any text here is left out of the fit
    radiance                    in any unit; fitted where brdf is empty in every row
    lamp_setting                rows with one number share a setting of the lamp, and its errors
    u_independent_relative      relative u of the row that no other row shares (in place of u_brdf)
    u_shared_NAME_relative      relative change of the row by one u of an error that rows share
    group_NAME                  rows with the same number share that error; absent: all rows do
    theta_i_by_NAME_deg, theta_r_by_NAME_deg, dphi_by_NAME_deg
                                change of the angles by one u of that error
    u_theta_i_deg, u_theta_r_deg, u_dphi_deg       standard uncertainty of each angle's setting
    blur_deg                    angle by which theta_r turned while the row's value was taken
    beam_length_mm, lamp_distance_mm               from the sample to the lens, and to the lamp
    source_solid_angle_sr, receiver_solid_angle_sr of lamp and lens, seen from the sample
    patch_width_mm, patch_height_mm                measured patch, the width along the camera's way
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator

from instrument.text.csv_column import Column

# Far beyond any measurement, but squares and ratios of such values do not overflow.
BRDF = Column("brdf", "1/sr", "-1e15 to 1e15 1/sr", -1e15, 1e15)
U_BRDF = Column("u_brdf", "1/sr", "1e-15 to 1e15 1/sr", 1e-15, 1e15)
ANGLES = (
    Column("theta_i_deg", "deg", "a number from 0 to 90 deg", 0.0, 90.0),
    Column("theta_r_deg", "deg", "a number from -90 to 90 deg", -90.0, 90.0),
    Column("dphi_deg", "deg", "a finite number of deg"),
)
NEEDED = (*ANGLES, BRDF)
COLUMNS = (*NEEDED, U_BRDF)

FLAGS = "flags"
RADIANCE = Column("radiance", "", "-1e15 to 1e15, in any unit", -1e15, 1e15)
LAMP_SETTING = Column("lamp_setting", "", "a whole number", -1e15, 1e15, whole=True)
U_INDEPENDENT = Column(
    "u_independent_relative", "", "1e-15 to 1e6, relative to the row's value", 1e-15, 1e6
)
U_ANGLES = tuple(
    Column(name, "deg", "0 to 90 deg", 0.0, 90.0)
    for name in ("u_theta_i_deg", "u_theta_r_deg", "u_dphi_deg")
)
BLUR = Column("blur_deg", "deg", "0 to 90 deg", 0.0, 90.0)
_DISTANCE = ("mm", "1e-3 to 1e6 mm", 1e-3, 1e6)
_SOLID_ANGLE = ("sr", "0 to 1 sr", 0.0, 1.0)
_SIDE = ("mm", "0 to 1e6 mm", 0.0, 1e6)
ACCEPTANCE = (
    Column("beam_length_mm", *_DISTANCE),
    Column("lamp_distance_mm", *_DISTANCE),
    Column("source_solid_angle_sr", *_SOLID_ANGLE),
    Column("receiver_solid_angle_sr", *_SOLID_ANGLE),
    Column("patch_width_mm", *_SIDE),
    Column("patch_height_mm", *_SIDE),
)
_OPTIONAL = (RADIANCE, LAMP_SETTING, U_INDEPENDENT, *U_ANGLES, BLUR, *ACCEPTANCE)
_READ = {FLAGS, *(column.name for column in (*COLUMNS, *_OPTIONAL))}
_SHARED = re.compile(r"u_shared_(.+)_relative|group_(.+)|(?:theta_[ir]|dphi)_by_(.+)_deg")


def is_read(name: str) -> bool:
    """True for the name of a column that is read; others are ignored."""
    return name in _READ or _SHARED.fullmatch(name) is not None


def read_names() -> tuple[str, ...]:
    """Names of all columns that are read, those about shared errors excepted."""
    return tuple(sorted(_READ))


def shared_stems(names: Iterable[str]) -> list[str]:
    """NAME of each `u_shared_NAME_relative` among the names of columns."""
    found = (_SHARED.fullmatch(name) for name in names)
    return [match[1] for match in found if match and match[1]]


def u_shared(stem: str) -> Column:
    """Column of an error's relative size in each row."""
    return Column(f"u_shared_{stem}_relative", "", "-1e6 to 1e6, relative", -1e6, 1e6)


def group(stem: str) -> Column:
    """Column of the number of an error's group."""
    return Column(f"group_{stem}", "", "a whole number", -1e15, 1e15, whole=True)


def angles_by(stem: str) -> tuple[Column, Column, Column]:
    """Columns of the change of theta_i, theta_r and dphi by one u of an error."""
    theta_i, theta_r, dphi = (
        Column(f"{angle}_by_{stem}_deg", "deg", "-90 to 90 deg", -90.0, 90.0)
        for angle in ("theta_i", "theta_r", "dphi")
    )
    return theta_i, theta_r, dphi


def stems(errors: Iterable[str]) -> Iterator[str]:
    """Names of shared errors as parts of columns' names; those of one name get a number each."""
    names = [name.replace(" ", "_") for name in errors]
    total, so_far = Counter(names), Counter[str]()
    for name in names:
        so_far[name] += 1
        yield name if total[name] == 1 else f"{name}_{so_far[name]}"


def error_name(stem: str) -> str:
    """Name of the shared error, from a part of its column's name: without number, with blanks."""
    return re.sub(r"_[0-9]+\Z", "", stem).replace("_", " ")
