"""Minimisation: agrees with SciPy, reaches bounds exactly, and reports no false minimum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import OptimizeResult, least_squares, lsq_linear

from analysis.fit.search.levenberg_marquardt import HUBER, Minimum, descend, loss, weights
from instrument.geometry import FloatArray
from tests.support.models.derivatives import central_difference

T = np.linspace(0, 3, 25)
NOISE = 0.02
NEUTRAL = np.array([0.7, 0.3, 0.0, 0.0])  # values of the parameters left out of a task
SEEDS = range(60)
# Lower bound relative to the truth, width of the box, and start as a fraction of the width.
BOX = st.tuples(st.floats(-1, 1), st.floats(0.05, 3), st.floats(0, 1))

Curve = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


def exponential(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """a exp(-b t) + c + d t and its derivatives, with as many of a, b, c, d as given."""
    a, b, c, d = np.append(x, NEUTRAL[x.size :])
    decay = np.exp(-b * T)
    gradients = np.stack([decay, -a * T * decay, np.ones_like(T), T], axis=1)
    return a * decay + c + d * T, gradients[:, : x.size]


def rational(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(a + c t) / (1 + b t + d t^2) and its derivatives, with as many of a, b, c, d as given."""
    a, b, c, d = np.append(x, NEUTRAL[x.size :])
    above, below = a + c * T, 1 + b * T + d * T * T
    gradients = np.stack(
        [1 / below, -above * T / below**2, T / below, -above * T * T / below**2], 1
    )
    return above / below, gradients[:, : x.size]


CURVES: tuple[Curve, ...] = (exponential, rational)


@dataclass
class Task:
    """Fit a curve to `y` with u = NOISE, within bounds."""

    curve: Curve
    y: FloatArray
    start: FloatArray
    low: FloatArray
    high: FloatArray
    huber: float | None = None

    def residual(self, x: FloatArray) -> FloatArray:
        return (self.curve(x)[0] - self.y) / NOISE

    def jacobian(self, x: FloatArray) -> FloatArray:
        return self.curve(x)[1] / NOISE

    def solve(self) -> Minimum:
        return descend(self.residual, self.jacobian, self.start, self.low, self.high, self.huber)

    def scipy(self, start: FloatArray) -> float:
        """SciPy's minimum of chi2 or of the robust loss, started off the bounds."""
        off = 1e-9 * (self.high - self.low)
        found: OptimizeResult = least_squares(
            self.residual, np.clip(start, self.low + off, self.high - off), self.jacobian,
            bounds=(self.low, self.high), x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14,
            loss="linear" if self.huber is None else "huber", f_scale=self.huber or 1.0,
            max_nfev=500,
        )  # fmt: skip
        return 2 * float(found.cost)


def true_values(rng: np.random.Generator) -> FloatArray:
    k = int(rng.integers(1, 5))
    return np.array([1.0, 0.8, 0.5, 0.2])[:k] * rng.uniform(0.5, 2, size=k)


def task(seed: int, huber: float | None = None, noise: float = NOISE) -> Task:
    """A random task of 1 to 4 parameters; with noise, half of them may end on a bound."""
    rng = np.random.default_rng(seed)
    curve, truth = CURVES[seed % 2], true_values(rng)
    k = truth.size
    y = curve(truth)[0] + noise * rng.normal(size=T.size)
    if huber is not None:
        y += (rng.uniform(size=T.size) < 0.1) * rng.normal(size=T.size)
    low = truth * (rng.choice([0.0, 1.1], size=k) if noise and seed % 4 > 1 else 0.0)
    high = low + truth * rng.uniform(1.2, 4, size=k)
    start = low + (high - low) * rng.uniform(0.2, 0.8, size=k)
    return Task(curve, y, start, low, high, huber)


@pytest.mark.parametrize("huber", [None, HUBER])
def test_minima_agree_with_scipy(huber: float | None) -> None:
    """SciPy's huber loss is the same sum: z up to 1, then 2 sqrt(z) - 1, of z = (r / HUBER)^2."""
    for seed in SEEDS:
        problem = task(seed, huber)
        found = problem.solve()
        assert found.converged, (seed, found.message)
        assert found.chi2 == pytest.approx(problem.scipy(problem.start), rel=1e-6), seed
        assert found.chi2 == loss(problem.residual(found.x), huber)


@settings(max_examples=60, derandomize=True)
@given(
    curve=st.sampled_from(CURVES),
    truth=st.lists(st.floats(0.1, 2.0), min_size=1, max_size=4),
    box=st.lists(BOX, min_size=4, max_size=4),
    huber=st.sampled_from([None, HUBER]),
)
def test_scipy_finds_nothing_lower_than_a_converged_minimum(
    curve: Curve,
    truth: list[float],
    box: list[tuple[float, float, float]],
    huber: float | None,
) -> None:
    below, width, part = np.array(box[: len(truth)]).T
    low = np.maximum(np.array(truth) + below, 0.0)
    y = curve(np.array(truth))[0] + NOISE * np.sin(40 * T)
    problem = Task(curve, y, low + part * width, low, low + width, huber)
    found = problem.solve()
    assert np.all((low <= found.x) & (found.x <= low + width))
    if found.converged:
        assert found.chi2 <= problem.scipy(found.x) * (1 + 1e-6) + 1e-12


@pytest.mark.slow
def test_nearly_all_searches_converge(slow: bool) -> None:
    count, failing = (400, 2) if slow else (150, 1)
    assert sum(task(seed).solve().converged for seed in range(count)) >= count - failing


def test_noise_free_data_are_recovered() -> None:
    for seed in SEEDS:
        found = task(seed, noise=0.0).solve()
        assert found.converged
        assert found.x == pytest.approx(true_values(np.random.default_rng(seed)), rel=1e-8), seed


def linear(seed: int, alike: float = 1.0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Columns (30, 3) that differ by `alike`, data (30,), and the approximate minimum (3,)."""
    rng = np.random.default_rng(seed)
    A = alike * rng.normal(size=(30, 3)) + (1 - alike) * rng.normal(size=(30, 1))
    x = rng.normal(size=3)
    return A, A @ x + 0.3 * rng.normal(size=30), x


def line(A: FloatArray, b: FloatArray, start: FloatArray, low: FloatArray, high: FloatArray) -> int:
    """Number of evaluations for a linear problem, compared with SciPy's exact minimum."""
    points: list[FloatArray] = []

    def residual(x: FloatArray) -> FloatArray:
        points.append(x)
        return A @ x - b

    found = descend(residual, lambda _: A, start, low, high)
    reference = lsq_linear(A, b, (low, high), method="bvls")
    assert found.converged
    assert found.chi2 == pytest.approx(2 * reference.cost, rel=1e-8)
    return len(points)


def test_a_linear_problem_takes_a_few_steps() -> None:
    for seed in SEEDS:
        A, b, _ = linear(seed)
        assert line(A, b, np.zeros(3), np.full(3, -9.0), np.full(3, 9.0)) <= 5


@pytest.mark.parametrize("alike", [1.0, 0.1, 0.01])
def test_bounds_and_nearly_equal_columns_do_not_end_the_search_early(alike: float) -> None:
    """A step along a valley, clipped at several bounds at once, would leave the valley."""
    for seed in SEEDS:
        A, b, x = linear(seed, alike)
        rng = np.random.default_rng(seed)
        low = x - rng.uniform(-0.5, 2, size=3)
        high = low + rng.uniform(0.1, 4, size=3)
        line(A, b, low + rng.uniform(size=3) * (high - low), low, high)


@pytest.mark.parametrize("bound", [0.7 / 1.1, 0.1 + 0.2, 1 / 7])
def test_a_minimum_on_a_bound_is_reached_exactly(bound: float) -> None:
    """To the last bit, even where x + (bound - x) is not the bound in floating point."""
    y = exponential(np.array([1.0, 0.05]))[0]
    for start in np.linspace(bound, 2.0, 21):
        low, high = np.array([0.0, bound]), np.array([2.0, 2.0])
        held = Task(exponential, y, np.array([0.5, start]), low, high).solve()
        assert held.converged
        assert held.x[1] == bound
    A = np.stack([np.ones_like(T), T], axis=1)
    low, high = np.array([-1.0, -bound]), np.array([bound, 5.0])
    both = descend(lambda x: A @ x - 16.2 + 9 * T, lambda _: A, np.array([-0.3, 4]), low, high)
    assert both.converged
    assert both.x.tolist() == [bound, -bound]


def test_a_start_on_the_bounds_is_left_where_chi2_falls_inwards() -> None:
    for seed in SEEDS:
        problem = task(seed, noise=0.0)
        inside = problem.solve()
        corner = Task(problem.curve, problem.y, problem.high, problem.low, problem.high)
        found = corner.solve()
        if found.chi2 < 1:  # some corners lead to another minimum
            assert found.x == pytest.approx(inside.x, rel=1e-6)
        assert found.chi2 <= corner.scipy(found.x) * (1 + 1e-6) + 1e-12


@pytest.mark.parametrize("high", [5.0, 0.7])
def test_two_equal_columns_share_what_they_explain(high: float) -> None:
    A = np.stack([T, T, np.ones_like(T)], axis=1)
    b = 1 + 2 * T + 0.1 * np.sin(9 * T)
    low, top = np.full(3, -5.0), np.full(3, high)
    found = descend(lambda x: A @ x - b, lambda _: A, np.zeros(3), low, top)
    assert found.converged
    reference = lsq_linear(A[:, 1:], b, (low[1:] * [2, 1], top[1:] * [2, 1]))
    assert found.chi2 == pytest.approx(2 * reference.cost, rel=1e-8)
    assert found.x[0] == pytest.approx(found.x[1], abs=1e-6)


@pytest.mark.parametrize("scale", [0.0, 1.0])
def test_a_column_of_zeros_leaves_its_parameter_unchanged(scale: float) -> None:
    A = np.stack([scale * T, 0 * T], axis=1)
    b = 1 + 2 * T
    low, high = np.full(2, -5.0), np.full(2, 5.0)
    found = descend(lambda x: A @ x - b, lambda _: A, np.array([0.0, 0.3]), low, high)
    assert found.converged
    assert found.x[1] == 0.3
    assert found.x[0] == pytest.approx(scale * (T @ b) / (T @ T))


@pytest.mark.parametrize(
    ("low", "high", "minimum"),
    [
        ((-2, -2), (2, 2), (1, 1)),
        ((-2, -2), (0.5, 2), (0.5, 0.25)),  # on the valley's floor y = x^2
        ((-2, -2), (2, 0.3), (0.551423, 0.3)),  # 200 x^3 + (1 - 60) x = 1 with y = 0.3
    ],
)
def test_rosenbrock_valley(
    low: tuple[float, float], high: tuple[float, float], minimum: tuple[float, float]
) -> None:
    """Rosenbrock, The Computer Journal 3 (1960): 100 (y - x^2)^2 + (1 - x)^2 from (-1.2, 1)."""

    def residual(x: FloatArray) -> FloatArray:
        return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])

    def jacobian(x: FloatArray) -> FloatArray:
        return np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])

    start = np.clip([-1.2, 1.0], low, high)
    found = descend(residual, jacobian, start, np.array(low, float), np.array(high, float))
    assert found.converged
    assert found.x == pytest.approx(minimum, abs=1e-6)


def test_large_residuals_do_not_make_the_search_crawl() -> None:
    """Problem of Brown and Dennis, minimum 85822.2; without second derivatives 1000 steps fail.

    J. J. Moré, B. S. Garbow, K. E. Hillstrom, "Testing Unconstrained Optimization Software", ACM
    Transactions on Mathematical Software 7 (1981), problem 16.
    """
    t = np.arange(1, 21) / 5

    def parts(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        return x[0] + t * x[1] - np.exp(t), x[2] + x[3] * np.sin(t) - np.cos(t)

    def residual(x: FloatArray) -> FloatArray:
        a, b = parts(x)
        return a * a + b * b

    def jacobian(x: FloatArray) -> FloatArray:
        a, b = parts(x)
        return 2 * np.stack([a, a * t, b, b * np.sin(t)], axis=1)

    start, far = np.array([25.0, 5.0, -5.0, -1.0]), np.full(4, 100.0)
    found = descend(residual, jacobian, start, -far, far, most_steps=40)  # takes 28
    assert found.converged
    assert found.chi2 == pytest.approx(85822.2, abs=0.05)


def test_no_minimum_is_reported_with_wrong_derivatives() -> None:
    claimed = 0
    for seed in SEEDS:
        A, b, _ = linear(seed)
        least = float(np.linalg.lstsq(A, b)[1][0])
        low, high = np.full(3, -9.0), np.full(3, 9.0)
        uphill = descend(lambda x: A @ x - b, lambda _: -A, np.zeros(3), low, high)  # noqa: B023
        assert not uphill.converged
        wrong = A * [-1, 1, 1]
        mirrored = descend(lambda x: A @ x - b, lambda _: wrong, np.zeros(3), low, high)  # noqa: B023
        claimed += mirrored.converged and mirrored.chi2 > 1.001 * least
    assert claimed == 0


def test_no_minimum_is_reported_when_the_steps_run_out() -> None:
    """Along y = x^2 to x = 1000; the gradient along it is 1e-7 of that of the valley's walls."""
    far = np.array([1e7, 1e7])
    found = descend(
        lambda x: np.array([1e4 * (x[1] - x[0] ** 2), 1e-3 * (x[0] - 1e3)]),
        lambda x: np.array([[-2e4 * x[0], 1e4], [1e-3, 0.0]]),
        np.zeros(2), -far, far,
    )  # fmt: skip
    assert not found.converged
    assert "100 steps" in found.message


def test_residuals_of_nan_are_not_a_minimum() -> None:
    found = descend(
        lambda _: np.full(3, np.nan), lambda _: np.ones((3, 1)),
        np.array([1.0]), np.array([0.0]), np.array([2.0]),
    )  # fmt: skip
    assert not found.converged


def test_the_huber_loss_is_quadratic_then_linear() -> None:
    """Huber 1964: continuous in value and derivative; the weight is the derivative over 2 r."""
    r = np.array([0.5, -1.0, HUBER, 3.0, -10.0])
    assert loss(r[:2], HUBER) == loss(r[:2]) == 1.25
    assert loss(r[3:4], HUBER) == pytest.approx(2 * HUBER * 3 - HUBER**2)
    gradient = [
        float(central_difference(lambda x: np.array(loss(np.array([x]), HUBER)), float(x), 1e-6))
        for x in r
    ]
    assert 2 * r * weights(r, HUBER) == pytest.approx(gradient, abs=1e-5)
    assert weights(r, None).tolist() == [1] * 5


def test_a_start_that_rounding_put_beyond_a_bound_counts_as_on_it() -> None:
    low, high = np.zeros(2), np.ones(2)
    A = np.array([[1.0, 0.3], [0.3, 1.0], [0.5, 0.2]])
    b = A @ np.array([2.0, 3.0])  # the minimum is beyond both bounds
    start = np.array([0.5, 1.0 + 2e-15])
    found = descend(lambda x: A @ x - b, lambda _: A, start, low, high)
    assert found.converged
    assert found.x.tolist() == [1.0, 1.0]


@given(st.floats(-320.0, -101.0), st.booleans())
def test_a_parameter_whose_effect_underflows_stays_where_it_is(power: float, bound: bool) -> None:
    J = np.array([[1.0, 0.0], [0.0, 10.0**power], [0.0, 10.0**power]])
    b = np.array([0.3, 1.0, 2.0])
    start = np.array([0.0, 0.0 if bound else 0.4])
    found = descend(lambda x: J @ x - b, lambda _: J, start, np.zeros(2), np.ones(2))
    assert found.x == pytest.approx([0.3, start[1]])
