"""Parameters of the fit of a rig's geometry, their starting values, and the pixels they predict."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.calibration.geometry.corners import Corners
from analysis.calibration.geometry.projection import Lens, on_table
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole

NAMES = (
    "field_percent", "beam_percent", "distortion_percent", "centre_column_px", "centre_row_px",
    "axis_column_px", "axis_row_px", "roll_deg", "zero_deg", "table_lean_deg", "height_mm",
    "lean_deg", "lean_across_deg", "y_mm", "x_mm", "turn_deg", "turned_x_mm", "turned_turn_deg",
    "sag_px", "row_sag_px",
)  # fmt: skip
"""Shared parameters. field, beam: above the starting camera's. zero: true angle minus shown one,
from the normal of the table. table_lean: of the table across the camera's plane. lean: of the board
on the table. x, y, turn: place of the board; y of the turned board is opposite. sag: of the beam,
which moves the picture along its columns by this times sin theta_r, as the height nearly does;
row_sag: along its rows."""
BEND_PX = 200.0
"""Distance from the middle of the board's picture at which a bend of it is stated."""
_STEP = 1e-3  # of each parameter in its unit, for derivatives
_AT = {name: number for number, name in enumerate(NAMES)}


@dataclass(frozen=True)
class Model:
    """Prediction of corners; `start` is the camera by the rig file.

    A vector of parameters holds those of `NAMES`, then groups of small deviations: `axis`, of each
    distinct view angle in degrees; `columns` and `rows`, shift of each picture in pixels; `bends`,
    four of each picture, linear in columns and rows, in pixels at `BEND_PX`; `print`, of each
    corner on the board, x and y in mm.
    """

    corners: Corners
    start: Pinhole

    @cached_property
    def groups(self) -> dict[str, slice]:
        """Place of each group of deviations in the vector."""
        pictures, at = self.corners.pictures, len(NAMES)
        sizes = {
            "axis": self.corners.angles[0].size,
            "columns": pictures,
            "rows": pictures,
            "bends": 4 * pictures,
            "print": 2 * len(self.corners.board_mm),
        }
        found = {}
        for name, size in sizes.items():
            found[name] = slice(at, at + size)
            at += size
        return found

    @property
    def size(self) -> int:
        """Number of parameters."""
        return int(self.groups["print"].stop)

    @cached_property
    def _angle(self) -> np.ndarray:
        """Number of each corner's view angle (n,)."""
        return self.corners.angles[1][self.corners.picture]

    @cached_property
    def _arms(self) -> FloatArray:
        """Place of each corner from the middle of its picture (n, 2), in units of `BEND_PX`."""
        own = self.corners
        count = np.maximum(np.bincount(own.picture, minlength=own.pictures), 1)
        sums = (np.bincount(own.picture, p, minlength=own.pictures) for p in own.pixels.T)
        middle = np.stack([total / count for total in sums], axis=1)
        return (own.pixels - middle[own.picture]) / BEND_PX

    def lens(self, vector: FloatArray) -> Lens:
        """Return the camera that a vector (parameters,), in the units of their names, describes."""
        own = dict(zip(NAMES, vector.tolist(), strict=False))
        return Lens(
            width_px=self.start.width_px,
            height_px=self.start.height_px,
            field_width_mm=self.start.field_width_mm * (1 + own["field_percent"] / 100),
            beam_length_mm=self.start.beam_length_mm * (1 + own["beam_percent"] / 100),
            axis_column_px=own["axis_column_px"],
            axis_row_px=own["axis_row_px"],
            roll_deg=own["roll_deg"],
            distortion=own["distortion_percent"] / 100,
            centre_column_px=own["centre_column_px"],
            centre_row_px=own["centre_row_px"],
        )

    def pixels(self, vector: FloatArray) -> FloatArray:
        """Return the predicted pixels (n, 2) of the corners."""
        printed = self.corners.board_mm + vector[self.groups["print"]].reshape(-1, 2)
        return self._shared(vector, printed[self.corners.number]) + self._moved(vector)

    def _shared(self, vector: FloatArray, points_mm: FloatArray) -> FloatArray:
        """Return the pixels (n, 2) of points (n, 2) of the board in mm, without picture's moves."""
        own = dict(zip(NAMES, vector.tolist(), strict=False))
        corners = self.corners
        turned = corners.turned[corners.picture]
        side = np.where(turned, -1.0, 1.0)
        shift = np.stack(
            [np.where(turned, own["turned_x_mm"], own["x_mm"]), side * own["y_mm"]], axis=1
        )
        table = on_table(
            points_mm,
            turn_deg=np.where(turned, own["turned_turn_deg"], own["turn_deg"]),
            shift_mm=shift,
            height_mm=own["height_mm"],
            lean_deg=side * own["lean_deg"],
            lean_across_deg=own["table_lean_deg"] + side * own["lean_across_deg"],
        )
        angle_deg = corners.theta_r_deg[corners.picture] + own["zero_deg"]
        angle_deg = angle_deg + vector[self.groups["axis"]][self._angle]
        seen = self.lens(vector).project(table, angle_deg)
        sags_px = np.array([own["sag_px"], own["row_sag_px"]])
        return np.asarray(seen + np.sin(np.radians(angle_deg))[:, np.newaxis] * sags_px)

    def _moved(self, vector: FloatArray) -> FloatArray:
        """Return the moves (n, 2) of corners with their pictures: shift, and bend."""
        picture = self.corners.picture
        shifts = np.stack([vector[self.groups[name]] for name in ("columns", "rows")], axis=1)
        bends = vector[self.groups["bends"]].reshape(-1, 2, 2)[picture]
        return np.asarray(shifts[picture] + np.einsum("nij,nj->ni", bends, self._arms))

    def jacobian(self, vector: FloatArray) -> FloatArray:
        """Return the derivatives (n, 2, parameters) of the predicted pixels."""
        own, groups = self.corners, self.groups
        points = own.board_mm[own.number] + vector[groups["print"]].reshape(-1, 2)[own.number]
        whole = np.zeros((own.picture.size, 2, self.size))
        for number in range(len(NAMES)):
            step = np.zeros(vector.size)
            step[number] = _STEP
            ahead, behind = (self._shared(vector + by, points) for by in (step, -step))
            whole[:, :, number] = (ahead - behind) / (2 * _STEP)
        rows = np.arange(own.picture.size)
        # A deviation of one view angle acts as the zero does on its own pictures.
        whole[rows, :, groups["axis"].start + self._angle] = whole[:, :, _AT["zero_deg"]]
        for axis, name in enumerate(("columns", "rows")):
            whole[rows, axis, groups[name].start + own.picture] = 1.0
            bend = groups["bends"].start + 4 * own.picture + 2 * axis
            moved = points + np.where(np.arange(2) == axis, _STEP, 0.0)
            print_at = groups["print"].start + 2 * own.number + axis
            change = self._shared(vector, moved) - self._shared(vector, points)
            whole[rows, :, print_at] = change / _STEP
            for arm in (0, 1):
                whole[rows, axis, bend + arm] = self._arms[:, arm]
        return whole

    def first(self) -> FloatArray:
        """Return starting values (parameters,), in the units of their names.

        They are those of the camera; each place of the board is taken from one picture.
        """
        vector = np.zeros(self.size)
        for name in ("axis_column_px", "axis_row_px", "roll_deg"):
            vector[_AT[name]] = getattr(self.start, name)
        for turned, (x, turn) in (
            (False, ("x_mm", "turn_deg")),
            (True, ("turned_x_mm", "turned_turn_deg")),
        ):
            place = self._place(turned)
            vector[_AT[x]], vector[_AT[turn]] = place[0], place[2]
            vector[_AT["y_mm"]] += place[1] / (-2 if turned else 2)
        return vector

    def _place(self, turned: bool) -> tuple[float, float, float]:
        """Return x and y in mm and turn in degrees of the board, from the picture nearest to 0."""
        corners = self.corners
        candidates = np.flatnonzero(corners.turned == turned)
        best = candidates[np.argmin(np.abs(corners.theta_r_deg[candidates]))]
        own = corners.picture == best
        homography = np.linalg.inv(self.start.homography(float(corners.theta_r_deg[best])))
        pixels = np.column_stack([corners.pixels[own], np.ones(int(own.sum()))]) @ homography.T
        seen, board = pixels[:, :2] / pixels[:, 2:], corners.board_mm[corners.number[own]]
        a, b = (v - v.mean(axis=0) for v in (board, seen))
        sine = float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
        turn = np.arctan2(sine, float(np.sum(a * b)))
        c, s = np.cos(turn), np.sin(turn)
        middle = seen.mean(axis=0) - np.array([[c, -s], [s, c]]) @ board.mean(axis=0)
        return float(middle[0]), float(middle[1]), float(np.degrees(turn))
