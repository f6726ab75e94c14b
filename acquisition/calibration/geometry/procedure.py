"""Measurement of a rig's geometry: pictures of the board at each pose, in its two places."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from acquisition.calibration.checks import SATURATED
from acquisition.calibration.exposure_search import exposure_reaching, share_of_scale
from acquisition.calibration.geometry.detection import Seen, find_corners, require_board
from acquisition.calibration.geometry.plan import LEAST_POSES, TARGET, GeometryPlan
from acquisition.engine.positioner import Positioner
from acquisition.plan.pose import Pose
from analysis.calibration.geometry.corners import Corners
from instrument.devices import BoardPlace, Camera, Lamp, Operator, Request
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray

_WHITE = 97.0  # percentile of a picture: white paper fills a tenth of it even at 60 degrees
_DIM, _BRIGHT = 0.25, 0.85  # shares of full scale between which an exposure is kept
_MOST_SATURATED = 1e-3  # of the pixels: hot ones may be
_HALF_TURN_DEG = 20.0  # how far the board may be off half a turn
_PLACES: tuple[tuple[BoardPlace, str], ...] = (
    (
        "board",
        "Lay the calibration board in the sample's place, print upwards, its middle on the axis, "
        "its upper edge up in the picture; the lamp is on, automatic exposure and gain are off",
    ),
    (
        "turned board",
        "Turn the board by half a turn (180 deg) in its own plane, in the same place; do not turn "
        "it over",
    ),
)


@dataclass(frozen=True, slots=True)
class _Picture:
    theta_r_deg: float
    turned: bool
    seen: Seen


@dataclass(slots=True, kw_only=True)
class GeometryCalibrator:
    """Devices of a rig at work on a plan; `say` tells the operator what is going on."""

    plan: GeometryPlan
    camera: Camera
    lamp: Lamp
    positioner: Positioner
    operator: Operator
    say: Callable[[str], None]
    skipped: list[str] = field(default_factory=list)
    _exposed: bool = False

    def measure(self) -> Corners:
        """Return the corners of all pictures. Raises `NotDetermined` if there are too few."""
        if self.plan.rig.lamp.darkened_by == "shutter":
            self.lamp.light()
        poses = self.plan.usable()
        pictures: list[_Picture] = []
        for place, text in _PLACES:
            self.operator.ask(Request("place", text, surface=place))
            turned = place == "turned board"
            pictures += self._seen(poses[::-1] if turned else poses, turned, pictures)
        self._require_enough(pictures)
        return _corners(pictures, self.plan)

    def _seen(self, poses: list[Pose], turned: bool, before: list[_Picture]) -> Iterator[_Picture]:
        """Yield the pictures of the board in one place; the first one must show it."""
        for number, pose in enumerate(poses):
            self.positioner.move_to(pose)
            where = f"at theta_r {pose.theta_r:g} deg"
            image = self._image(where)
            self.positioner.require_in_place()
            seen = find_corners(image, self.plan.board)
            self.say(
                f"{'turned board' if turned else 'board'} {where}: {len(seen.numbers)} corners"
            )
            try:
                require_board(image, seen, self.plan.board, where)
            except NotDetermined as error:
                if number == 0:
                    raise
                self.skipped.append(str(error))
                continue
            if turned and number == 0:
                _require_half_turn(before[-1].seen, seen, self.plan)
            yield _Picture(pose.theta_r, turned, seen)

    def _image(self, where: str) -> FloatArray:
        """Return the mean of the frames (rows, columns) in counts, at an exposure that suits."""
        image = self._frames() if self._exposed else None
        if image is None or not _DIM < self._share(image) < _BRIGHT or self._saturated(image):
            self._search()
            image = self._frames()
        if self._saturated(image):
            raise NotDetermined(
                f"board {where}: it is saturated at the shortest exposure that the search found. "
                "Take less light, turn gloss away from the camera (--theta-i-deg), or lower "
                "min_exposure_s if the camera can do less"
            )
        return image

    def _search(self) -> None:
        def share(exposure_s: float) -> float:
            self.camera.set_exposure_s(exposure_s)
            return self._share(self.camera.grab(1)[0].image)

        camera = self.plan.rig.camera
        self.camera.set_exposure_s(exposure_reaching(TARGET, share, camera))
        self._exposed = True

    def _frames(self) -> FloatArray:
        frames = self.camera.grab(self.plan.frames)
        return np.asarray(np.mean([f.image for f in frames], axis=0, dtype=np.float64))

    def _share(self, image: np.ndarray) -> float:
        return share_of_scale(float(np.percentile(image, _WHITE)), self.plan.rig.camera)

    def _saturated(self, image: FloatArray) -> bool:
        most = SATURATED * self.plan.rig.camera.max_dn
        return bool(np.mean(image >= most) > _MOST_SATURATED)

    def _require_enough(self, pictures: list[_Picture]) -> None:
        for turned in (False, True):
            own = [p for p in pictures if p.turned == turned]
            if len(own) < LEAST_POSES:
                raise NotDetermined(
                    f"the {'turned ' if turned else ''}board was seen in {len(own)} pictures; "
                    f"needed: {LEAST_POSES}.\n" + "\n".join(self.skipped)
                )


def _require_half_turn(first: Seen, second: Seen, plan: GeometryPlan) -> None:
    """Raise `NotDetermined` unless the board was turned; both pictures are of one pose."""
    turn = (second.turn_deg(plan.board) - first.turn_deg(plan.board)) % 360
    if abs(turn - 180) > _HALF_TURN_DEG:
        raise NotDetermined(
            f"the board was turned by {turn:.0f} deg; needed: 180, to {_HALF_TURN_DEG:g}, in its "
            "own plane. Begin again"
        )


def _corners(pictures: list[_Picture], plan: GeometryPlan) -> Corners:
    sizes = [len(p.seen.numbers) for p in pictures]
    return Corners(
        board_mm=plan.board.corners_mm(),
        number=np.concatenate([p.seen.numbers for p in pictures]),
        pixels=np.concatenate([p.seen.pixels for p in pictures]),
        picture=np.repeat(np.arange(len(pictures)), sizes),
        theta_r_deg=np.array([p.theta_r_deg for p in pictures]),
        turned=np.array([p.turned for p in pictures]),
    )
