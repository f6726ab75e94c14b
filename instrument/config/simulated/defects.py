"""Defects of a simulated bench: lamp, lens, surroundings, mechanics. All are absent unless given.

Those of the camera's sensor are in `instrument.config.camera`.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from instrument.config.section import Positive, Section
from instrument.config.simulated.spread import Share, Signed, Size, Spread


class LampDefects(Section):
    """Lamp that warms up, flickers, and lights the sample unevenly.

    `warm_up`: share of the light that is missing at the start of the scan; it comes with the time
    constant `warm_up_s`. `flicker`: relative standard deviation of the light from frame to frame.
    `spot_fwhm_mm`: full width at half maximum of the beam at the sample, which is Gaussian; it is
    even if omitted. `aim_x_mm`, `aim_y_mm`: distance of the beam from the rotation axis, across
    the beam, in and out of the plane of incidence. `polarisation`: relative excess of light that
    vibrates across the plane of the sample's normal and of the lamp.
    """

    warm_up: Share = 0.0
    warm_up_s: Annotated[Positive, Spread.SIZE] = 600.0
    flicker: Share = 0.0
    spot_fwhm_mm: Positive | None = None
    aim_x_mm: Signed = 0.0
    aim_y_mm: Signed = 0.0
    polarisation: Annotated[float, Field(ge=-1, le=1), Spread.SIGNED] = 0.0


class LensDefects(Section):
    """Lens that darkens and bends the picture, and scatters light.

    `axis_column_px`, `axis_row_px`: optical axis of the lens, from the middle of the picture.
    `vignetting`: relative loss of light, beyond cos^4, at half the picture's diagonal from the
    lens's axis; it grows with the square of that distance. `distortion`: relative displacement of a
    point at the same distance, to the outside if positive (pincushion) and to the inside if
    negative (barrel). `defocus_px`: standard deviation of the picture of a point. `glare`: share
    of the light that is scattered; half of it falls within sqrt(3) `glare_width` times the
    picture's width. `polarisation`: relative excess of the camera's response to light that vibrates
    along its columns, across the plane in which it swings.
    """

    axis_column_px: Signed = 0.0
    axis_row_px: Signed = 0.0
    vignetting: Share = 0.0
    distortion: Annotated[float, Field(ge=-0.2, le=0.2), Spread.SIGNED] = 0.0
    defocus_px: Size = 0.0
    glare: Share = 0.0
    glare_width: Annotated[float, Field(ge=0.02, le=2)] = 0.15
    polarisation: Annotated[float, Field(ge=-1, le=1), Spread.SIGNED] = 0.0


class Placement(Section):
    """Place of a surface on the table.

    `tilt_deg`: lean of its normal to the side of positive theta_r, `tilt_across_deg`: towards
    positive y. `shift_x_mm`, `shift_y_mm`, `turn_deg`: its middle, and its turn in its own plane,
    anticlockwise as seen from above.
    """

    tilt_deg: Annotated[float, Field(ge=-10, le=10), Spread.SIGNED] = 0.0
    tilt_across_deg: Annotated[float, Field(ge=-10, le=10), Spread.SIGNED] = 0.0
    shift_x_mm: Signed = 0.0
    shift_y_mm: Signed = 0.0
    turn_deg: Annotated[float, Field(ge=-180, le=180), Spread.SIGNED] = 0.0


class AxisDefects(Section):
    """Axis whose true angle is not the one that it shows.

    `zero_deg`: true angle minus the one shown, at each angle. `cyclic_deg`: amplitude of an error
    that goes through one period per turn; its phase is drawn from the seed. `latency_s`: age of the
    position that it reports while it moves, relative to the time stamps of the frames.
    """

    zero_deg: Annotated[float, Field(ge=-10, le=10), Spread.SIGNED] = 0.0
    cyclic_deg: Annotated[float, Field(ge=0, le=10), Spread.SIZE] = 0.0
    latency_s: Annotated[float, Field(ge=-0.2, le=0.2)] = 0.0


class BeamDefects(AxisDefects):
    """Axis of the camera's beam, which also moves the picture.

    `sag_px`: the beam bends under the camera's weight, so that the picture moves along its columns
    by this times sin theta_r. `wobble_px`: amplitude of the movement along its rows by the wobble
    of the axis, one period per turn; its phase is drawn from the seed. Picture without roll.
    """

    sag_px: Signed = 0.0
    wobble_px: Size = 0.0


class AxesDefects(Section):
    """Defects of each axis."""

    theta_i: AxisDefects = AxisDefects()
    dphi: AxisDefects = AxisDefects()
    theta_r: BeamDefects = BeamDefects()

    def __getitem__(self, axis: str) -> AxisDefects:
        """Return the defects of an axis by its name."""
        defects: AxisDefects = getattr(self, axis)
        return defects
