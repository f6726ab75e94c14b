"""Rectified pictures: each cell has the light of its place, and the noise that is foretold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.measure.rectify.cell_grid import CellGrid
from acquisition.measure.rectify.light import light_dn
from acquisition.measure.rectify.rectified import off_edge, rectify, sampling
from instrument.config.protocol import Sample
from instrument.config.simulated.defects import LensDefects
from instrument.errors import InputError
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole, apply_homography
from sim.defects.lens import bent_by_lens
from tests.support.scans import small_scan


def _camera(seed: int) -> Pinhole:
    random = np.random.default_rng(seed)
    width, height = (int(n) for n in random.integers(80, 200, 2))
    return Pinhole(
        beam_length_mm=float(random.uniform(400, 2000)),
        field_width_mm=float(random.uniform(60, 90)),
        width_px=width,
        height_px=height,
        axis_column_px=width / 2 + float(random.uniform(-8, 8)),
        axis_row_px=height / 2 + float(random.uniform(-8, 8)),
        roll_deg=float(random.uniform(-5, 5)),
    )


def _surface(points_mm: FloatArray) -> FloatArray:
    x, y = points_mm[..., 0], points_mm[..., 1]
    return np.asarray(100 + 3 * x - 2 * y + 4 * np.sin(x / 4) * np.cos(y / 5))


def _seen(camera: Pinhole, theta_r_deg: float) -> FloatArray:
    columns, rows = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    back = np.linalg.inv(camera.homography(theta_r_deg))
    pixels = np.stack([columns, rows], axis=-1).astype(np.float64)
    ideal = pixels
    for _ in range(12):  # the picture is bent by less than itself
        ideal = ideal + pixels - camera.bent(ideal)
    return _surface(apply_homography(back, ideal))


@pytest.mark.parametrize("seed", range(8))
def test_a_cell_has_the_light_of_its_place(seed: int) -> None:
    random = np.random.default_rng(seed + 100)
    camera, view = _camera(seed), float(random.uniform(-60, 60))
    if seed % 2:
        camera = replace(camera, distortion=float(random.uniform(-0.05, 0.05)))
    grid = CellGrid(float(random.uniform(1.2, 3.0)), 9, 11)
    light = _seen(camera, view).astype(np.float32)
    found = rectify(light, grid, camera, view)
    true = _surface(np.stack(np.meshgrid(grid.x_mm, grid.y_mm), axis=-1))
    assert np.isfinite(found).any()
    inside = np.isfinite(found)
    assert np.abs(found - true)[inside].max() < 0.35  # of a range of about 100


def test_a_lens_that_bends_the_picture_as_the_simulated_one_is_straightened() -> None:
    straight, lens = _camera(4), LensDefects(distortion=-0.03)
    light = bent_by_lens(_seen(straight, 30.0).astype(np.float32), lens)
    grid = CellGrid(1.5, 21, 21)
    true = rectify(_seen(straight, 30.0).astype(np.float32), grid, straight, 30.0)
    blind, known = (
        np.abs(rectify(light, grid, replace(straight, distortion=d), 30.0) - true)
        for d in (0.0, -0.03)
    )
    assert np.nanmax(known) < 0.3 * np.nanmax(blind)


@pytest.mark.parametrize("seed", range(6))
def test_the_noise_of_a_cell_is_the_one_foretold(seed: int) -> None:
    random = np.random.default_rng(seed)
    camera, view = _camera(seed), float(random.uniform(-80, 80))
    grid = CellGrid(float(random.choice([0.9, 1.3, 3.7])), 24, 24)
    noise = random.standard_normal((40, camera.height_px, camera.width_px)).astype(np.float32)
    cells = np.stack([rectify(n, grid, camera, view) for n in noise])
    expected = sampling(grid, camera, view).noise
    inside = np.isfinite(cells).all(axis=0)
    assert np.mean(np.var(cells[:, inside], axis=0)) == pytest.approx(expected, rel=0.12)


def test_a_cell_at_grazing_counts_by_the_share_that_is_resolved() -> None:
    camera = _camera(1)
    grid = CellGrid(2 * camera.field_width_mm / camera.width_px, 4, 4)
    shares = [sampling(grid, camera, view).share for view in (0.0, 50.0, 70.0, 85.0)]
    assert shares[0] == shares[1] == 1.0
    assert shares[2] == pytest.approx(2 * np.cos(np.radians(70)), rel=0.02)
    assert shares[3] == pytest.approx(2 * np.cos(np.radians(85)), rel=0.02)


def test_cells_off_the_picture_or_on_saturated_pixels_have_no_value() -> None:
    camera = _camera(2)
    light = np.ones((camera.height_px, camera.width_px), dtype=np.float32)
    grid = CellGrid(5.0, 41, 41)
    found = rectify(light, grid, camera, 0.0)
    outside = np.hypot(grid.x_mm, 0)[np.newaxis, :] > camera.field_width_mm / 2 + 10
    assert np.isnan(found[:, outside[0]]).all()
    assert found[20, 20] == pytest.approx(1.0)
    column, row = (round(n) for n in camera.project([0.0, 0.0], 0.0).tolist())
    light[row, column] = np.nan
    assert np.isnan(rectify(light, grid, camera, 0.0)[20, 20])
    assert np.isnan(rectify(light, grid, camera, 0.0)).sum() - np.isnan(found).sum() <= 4


def test_light_is_the_mean_of_frames_less_the_dark_without_hot_pixels() -> None:
    camera = small_scan().rig.camera
    pinhole = Pinhole.of(small_scan().rig)
    random = np.random.default_rng(3)
    shape = pinhole.height_px, pinhole.width_px
    frames = random.integers(200, 3000, (3, *shape)).astype(np.uint16)
    dark = random.uniform(60, 70, shape)
    hot = np.zeros(shape, dtype=bool)
    hot[5, 6] = True
    frames[:, 5, 6] = 4095
    frames[1, 9, 9] = 4095
    found = light_dn(frames, dark, hot, camera, pinhole)
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    expected = (frames.astype(float).mean(axis=0) - dark) / pinhole.cos4(columns, rows)
    usual = ~hot
    usual[9, 9] = False
    assert found[usual] == pytest.approx(expected[usual], rel=1e-5)
    assert np.isnan(found[9, 9])
    around = np.delete(expected[4:7, 5:8].ravel(), 4)
    assert around.min() <= found[5, 6] <= around.max()


def test_the_edge_of_the_sample_is_left_out_by_what_blurs_it() -> None:
    grid = CellGrid(1.0, 10, 20)
    kept = off_edge(grid, (20.0, 10.5), (2.0, 0.0))
    assert kept[:, :2].sum() == kept[:, -2:].sum() == 0
    assert kept[:, 2:-2].all()


def test_a_grid_holds_whole_cells_of_a_size_that_the_camera_resolves() -> None:
    rig = small_scan().rig  # pixels of 72 mm / 128
    sample = Sample(name="a", width_mm=50.0, height_mm=30.0)
    grid = CellGrid.of(sample, rig, 0.7)
    assert (grid.rows, grid.columns) == (42, 71)
    assert grid.x_mm.sum() == pytest.approx(0)
    assert CellGrid.of(sample, rig, 0.6).rows == 50
    assert grid.to_mm() @ [3, 4, 1] == pytest.approx([grid.x_mm[3], grid.y_mm[4], 1])
    for wrong in (0.5, 15.1, float("nan")):
        with pytest.raises(InputError, match=r"cell_mm: .* mm; allowed: 0.5625 .* to 15 mm"):
            CellGrid.of(sample, rig, wrong)
