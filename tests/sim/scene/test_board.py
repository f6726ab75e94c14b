"""Board in the scene: its print lies where the camera's own projection has it."""

from __future__ import annotations

import numpy as np
import pytest

from instrument.board import Board
from instrument.config.load import load_rig
from instrument.devices import Request
from instrument.pinhole import Pinhole, apply_homography
from sim.clock import SimulatedClock
from sim.scene.operator import SimulatedOperator
from sim.scene.render import electrons_per_s
from sim.scene.scene import Scene
from tests.support.paths import CONFIGS


def scene_with(board: Board, place: str, theta_r_deg: float) -> Scene:
    scene = Scene.of_white_sample(load_rig(CONFIGS / "rigs" / "bench_12bit.yaml"))
    scene.board = board
    scene.true_deg = {"theta_i": 20.0, "dphi": 0.0, "theta_r": theta_r_deg}
    scene.heights_mm["board"] = scene.heights_mm["turned board"] = 0.0
    ask = Request("place", "", surface="turned board" if place == "turned board" else "board")
    SimulatedOperator(scene, SimulatedClock()).ask(ask)
    return scene


@pytest.mark.parametrize("place", ["board", "turned board"])
@pytest.mark.parametrize("theta_r_deg", [-50.0, 0.0])
def test_squares_are_black_and_white_where_they_should_be(place: str, theta_r_deg: float) -> None:
    """The middle of each black square, and the corner of each white one outside its marker."""
    board = Board()
    scene = scene_with(board, place, theta_r_deg)
    image = electrons_per_s(scene)
    numbers = np.arange(board.columns) - (board.columns - 1) / 2
    middles = board.square_mm * np.stack(np.meshgrid(numbers, -numbers), axis=-1)
    row, column = np.indices((board.rows, board.columns))
    black = (row + column) % 2 == 0
    rim = middles + 0.44 * board.square_mm * np.array([1.0, 1.0])
    points = np.where(black[..., np.newaxis], middles, rim)
    points = -points if place == "turned board" else points
    camera = Pinhole.of(scene.rig).homography(theta_r_deg)
    pixels = np.rint(apply_homography(camera, points)).astype(int)
    light = image[pixels[..., 1], pixels[..., 0]]
    assert light[black].max() < 0.15 * light[~black].min()


def test_a_pixel_averages_the_edge_that_crosses_it() -> None:
    """Light over the picture does not depend on how edges fall on pixels."""
    totals = []
    for angle in (0.0, 0.02, 0.04):
        scene = scene_with(Board(), "board", angle)
        totals.append(float(electrons_per_s(scene).sum()))
    assert np.ptp(totals) < 2e-4 * totals[0]
