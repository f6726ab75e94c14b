"""Interpolation of a tile's radiance factors: exact where it must be, and its uncertainty."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from instrument.calibration.tile_table import OutsideTable, TileTable

SEEDS = st.integers(0, 2**32 - 1)


def random_table(random: np.random.Generator, beta: float | None = None) -> TileTable:
    """A table of random angles; of random values, neither smooth nor reciprocal, or all `beta`."""
    sizes = [int(n) for n in random.integers(1, 6, 3)]
    spans = ((0.0, 85.0), (-80.0, 80.0), (0.0, 180.0))
    axes = [np.sort(random.uniform(*span, n)) for span, n in zip(spans, sizes, strict=True)]
    values = random.uniform(0.5, 1.5, sizes) if beta is None else np.full(sizes, beta)
    u, common = random.uniform(0, 0.01, (2, *sizes))
    return TileTable((axes[0], axes[1], axes[2]), values, u, common)


def inside(table: TileTable, random: np.random.Generator) -> tuple[float, float, float]:
    """A geometry in the table: each angle anywhere in it, or at one of its own."""
    found = [
        float(random.choice(axis) if random.random() < 0.3 else random.uniform(axis[0], axis[-1]))
        for axis in table.axes_deg
    ]
    return found[0], found[1], found[2]


@given(SEEDS)
def test_at_its_own_angles_a_table_gives_its_own_values(seed: int) -> None:
    random = np.random.default_rng(seed)
    table = random_table(random)
    index = tuple(int(random.integers(n)) for n in table.beta.shape)
    angles = [float(axis[i]) for axis, i in zip(table.axes_deg, index, strict=True)]
    found = table.at(angles[0], angles[1], angles[2])
    assert found.beta == table.beta[index]
    assert found.u_between == 0
    assert found.u_common == table.u_common[index]
    assert max(found.u_corners) == table.u_beta[index]
    assert np.count_nonzero(found.u_corners) <= 1


@given(SEEDS, st.floats(0.5, 1.5))
def test_a_constant_table_equals_one_number_exactly(seed: int, beta: float) -> None:
    random = np.random.default_rng(seed)
    table = random_table(random, beta)
    found = table.at(*inside(table, random))
    assert (found.beta, found.u_between) == (beta, 0.0)


@settings(max_examples=20)
@given(SEEDS)
def test_a_value_lies_between_its_corners_and_moves_with_each_by_its_u(seed: int) -> None:
    """The parts of u are the effect of changing one value of the table by its own u."""
    random = np.random.default_rng(seed)
    table, angles = random_table(random), None
    angles = inside(table, random)
    found = table.at(*angles)
    used = {c: u for c, u in zip(found.corners, found.u_corners, strict=True) if u > 0}
    assert sum(u > 0 for u in found.u_corners) == len(used)
    values = table.beta.ravel()[list(used)]
    assert values.min() - 1e-12 <= found.beta <= values.max() + 1e-12
    for number in range(table.beta.size):
        moved = table.beta.copy()
        moved.ravel()[number] += table.u_beta.ravel()[number]
        other = TileTable(table.axes_deg, moved, table.u_beta, table.u_common)
        change = other.at(*angles).beta - found.beta
        assert change == pytest.approx(used.get(number, 0.0), abs=1e-12)


@settings(max_examples=20)
@given(SEEDS)
def test_each_value_has_one_place_among_the_corners(seed: int) -> None:
    """Else two geometries that use one value would not be known to share its error."""
    random = np.random.default_rng(seed)
    table, places = random_table(random), {}
    for _ in range(20):
        found = table.at(*inside(table, random))
        for place, (number, u) in enumerate(zip(found.corners, found.u_corners, strict=True)):
            if u > 0:
                assert places.setdefault(number, place) == place


def test_reciprocity_is_not_assumed() -> None:
    axis = np.array([0.0, 60.0])
    values = np.array([[[1.0], [0.9]], [[1.1], [1.0]]])
    table = TileTable((axis, axis, np.array([0.0])), values, 0 * values, 0 * values)
    assert table.at(60.0, 0.0, 0.0).beta == 1.1
    assert table.at(0.0, 60.0, 0.0).beta == 0.9


@settings(max_examples=30)
@given(SEEDS)
def test_one_direction_has_one_value_however_it_is_stated(seed: int) -> None:
    """By a signed theta_r, by dphi and its half turn, mirrored, or turned right round."""
    random = np.random.default_rng(seed)
    axes = (np.array([0.0, 40.0, 80.0]), np.array([0.0, 30.0, 60.0]), np.linspace(0, 180, 4))
    values = random.uniform(0.5, 1.5, (3, 3, 4))
    table = TileTable(axes, values, 0 * values, 0 * values)
    theta_i, theta_r, dphi = random.uniform((0.1, 0.1, 0), (80, 60, 180))
    expected = table.at(theta_i, theta_r, dphi).beta
    for forms in ((theta_r, -dphi), (theta_r, dphi + 360), (-theta_r, dphi + 180),
                  (-theta_r, 180 - dphi), (-theta_r, dphi - 180)):  # fmt: skip
        assert table.at(theta_i, *forms).beta == pytest.approx(expected, rel=1e-9)


def test_along_the_normal_any_dphi_is_the_same() -> None:
    axes = (np.array([0.0, 60.0]), np.array([0.0, 10.0]), np.array([0.0]))
    values = np.arange(4.0).reshape(2, 2, 1) / 10 + 0.8
    table = TileTable(axes, values, 0 * values, 0 * values)
    assert table.at(60.0, 0.0, 90.0).beta == table.at(60.0, 0.0, 0.0).beta == 1.0
    assert table.at(0.0, 10.0, 37.0).beta == pytest.approx(0.9)
    with pytest.raises(OutsideTable):
        table.at(60.0, 10.0, 90.0)


@pytest.mark.parametrize("step_deg", [5.0, 10.0, 15.0])
def test_the_u_of_interpolation_covers_the_error_on_a_falling_curve(step_deg: float) -> None:
    """A tile that falls as a cosine: the error of each interpolation is within its u, or about."""
    axis = np.arange(0.0, 76.0, step_deg)
    curve = 0.9 + 0.2 * np.cos(np.radians(axis))
    values = curve.reshape(-1, 1, 1)
    table = TileTable((axis, np.array([10.0]), np.array([0.0])), values, 0 * values, 0 * values)
    for angle in np.linspace(1.0, axis[-1], 30):
        found = table.at(float(angle), 10.0, 0.0)
        error = abs(found.beta - 0.9 - 0.2 * np.cos(np.radians(angle)))
        assert error <= 1.1 * found.u_between + 1e-12
        assert found.u_between <= 2.0 * error + 1e-5


def test_two_values_show_no_bend_so_that_a_share_of_their_difference_counts() -> None:
    axis, values = np.array([30.0, 60.0]), np.array([1.0, 0.9]).reshape(2, 1, 1)
    table = TileTable((axis, np.array([0.0]), np.array([0.0])), values, 0 * values, 0 * values)
    assert table.at(45.0, 0.0, 0.0).u_between == pytest.approx(0.25 * 0.1)


def test_an_angle_outside_is_named_with_the_range() -> None:
    axes = (np.array([0.0, 60.0]), np.array([10.0]), np.array([0.0, 180.0]))
    values = np.ones((2, 1, 2))
    table = TileTable(axes, values, 0 * values, 0 * values)
    for angles, text in {
        (75.0, 10.0, 0.0): "theta_i 75 deg; the table has 0 to 60 deg",
        (30.0, 20.0, 0.0): "theta_r 20 deg; the table has only 10 deg",
    }.items():
        with pytest.raises(OutsideTable, match=text):
            table.at(*angles)
    narrow = TileTable((axes[0], axes[1], np.array([0.0])), values[:, :, :1], values, values)
    with pytest.raises(OutsideTable, match="dphi 90 deg; the table has only 0 deg"):
        narrow.at(30.0, 10.0, 90.0)


@given(SEEDS)
def test_outside_is_outside_by_any_angle_alone(seed: int) -> None:
    random = np.random.default_rng(seed)
    table = random_table(random)
    angles = list(inside(table, random))
    below, above = table.axes_deg[0][0] - 1e-3, table.axes_deg[0][-1] + 1e-3
    for angles[0] in (below, above):
        with pytest.raises(OutsideTable, match="theta_i "):
            table.at(*angles)


def test_tables_of_one_text_are_equal() -> None:
    one, other, third = (
        TileTable((np.zeros(1),) * 3, *np.full((3, 1, 1, 1), beta), text)
        for beta, text in ((1.0, "a"), (0.9, "a"), (1.0, "b"))
    )
    assert one == other
    assert one != third
