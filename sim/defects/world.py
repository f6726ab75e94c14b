"""Faults of the world: what is wrong with lamp, light, sample and sensor though no device says so.

`World` is the state of all of them at one moment. `sim.scene` shows it, `sim.faults` changes it in
mid-scan; the noise of the frames stays that of a scan without faults.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, get_args

from instrument.geometry import FloatArray
from sim.defects.mechanics import placement

Mounted = Literal["as asked", "sample", "white tile", "nothing"]


@dataclass(frozen=True, slots=True)
class World:
    """Faults by name; each default is a world without that fault.

    Light: `lamp`, `lens`: factors of the light. `flicker`: its relative standard deviation from
    frame to frame. `shutter_open`, `shutter_shut`: share that passes the shutter, or the lid, when
    it should be open or shut. `room`, `spot`: light from elsewhere on all of the picture or on a
    spot, and `glare`: light scattered in the lens; in units of the lamp's on white and of the
    picture's mean. `shadow`: share of the picture's columns in the shadow of a hand. `blur_mm`:
    standard deviation of an image out of focus, at the axis.

    Mechanics: `theta_i_deg`, `dphi_deg`, `theta_r_deg`: true angle minus the one the axis shows.
    `shift_mm` (along x), `turn_deg` (in its plane), `tilt_deg` (towards the camera's positive
    side): place of the surface. `mounted`: what lies on the table.

    Camera: `exposure`: factor of the true exposure. `control`: factor of the exposure that another
    program has set, and that the camera reports. `gain`: factor of the counts that the camera
    reports, `amplifier`: one that it does not. `black_dn`: shift of the black level. `gamma`:
    exponent of the counts. `noise`: factor of the noise. `hot_px`: side in pixels of a cluster of
    hot pixels, `dead_columns`: columns without counts, both in the window. `stuck_bit`: number of
    a bit of each count that is always 1. `black_rows`: share of the rows that is lost in the third
    frame of each series. `repeats`: 1 if that frame is the one before it again. `stale`: 1 if the
    first frame is from before the series. `frozen`: 1 if all frames are the last one.
    """

    lamp: float = 1.0
    lens: float = 1.0
    flicker: float = 0.0
    shutter_open: float = 1.0
    shutter_shut: float = 0.0
    room: float = 0.0
    spot: float = 0.0
    glare: float = 0.0
    shadow: float = 0.0
    blur_mm: float = 0.0
    theta_i_deg: float = 0.0
    dphi_deg: float = 0.0
    theta_r_deg: float = 0.0
    shift_mm: float = 0.0
    turn_deg: float = 0.0
    tilt_deg: float = 0.0
    mounted: Mounted = "as asked"
    exposure: float = 1.0
    control: float = 1.0
    gain: float = 1.0
    amplifier: float = 1.0
    black_dn: float = 0.0
    gamma: float = 1.0
    noise: float = 1.0
    hot_px: int = 0
    dead_columns: int = 0
    stuck_bit: int = -1
    black_rows: float = 0.0
    repeats: int = 0
    stale: int = 0
    frozen: int = 0

    def changed(self, name: str, value: str) -> World:
        """Return the world with one fault at another size; raise `ValueError` if it has none."""
        if name not in self.__slots__:
            raise ValueError(f"no fault {name!r}; allowed: {', '.join(self.__slots__)}")
        if name == "mounted":
            allowed: tuple[Mounted, ...] = get_args(Mounted)
            if value not in allowed:
                raise ValueError(f"{value!r}; allowed: {', '.join(allowed)}")
            return replace(self, mounted=next(kind for kind in allowed if kind == value))
        return replace(self, **{name: type(getattr(self, name))(value)})

    def light(self, lit: bool) -> float:
        """Return the factor of the lamp's light in the picture, with the shutter open or shut."""
        return self.lamp * self.lens * (self.shutter_open if lit else self.shutter_shut)

    def placement(self) -> FloatArray:
        """Return the matrix (3, 3) from points (x, y, 1), in mm, of the surface to the table."""
        return placement(self.shift_mm, 0.0, self.turn_deg)


SOUND = World()
