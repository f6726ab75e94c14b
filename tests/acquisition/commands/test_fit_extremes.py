"""`gonio fit` of extreme tables: any finite numbers lead to a result, without a warning."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from analysis.choice.ladder import CANDIDATES
from analysis.models import MODELS
from instrument.geometry import FloatArray
from tests.support.command import gonio_here as gonio

CASES, ALL_CASES = 15, 1500
FAILED_ONCE = (49, 1075, 1236)  # seeds: quotients beyond a double; no light but at grazing view
ANGLES_DEG = (0.0, 5.0, 30.0, 45.0, 60.0, 75.0, 89.99, 90.0)
HEADER = "theta_i_deg,theta_r_deg,dphi_deg,brdf"


@pytest.mark.slow
def test_any_table_leads_to_a_result(tmp_path: Path, slow: bool) -> None:
    """Seeded cases; a numpy warning is an error in this test run."""
    for seed in range(ALL_CASES) if slow else (*range(CASES), *FAILED_ONCE):
        rng = np.random.default_rng(seed)
        path = tmp_path / f"{seed}.csv"
        path.write_text(table(rng))
        options = [
            *some_models(rng),
            *(o for o in ("--robust", "--relative") if rng.random() < 0.2),
        ]
        as_json = ["--json"] if rng.random() < 0.7 else []
        done = gonio("fit", path, *options, *as_json)
        assert done.returncode in (0, 5), (seed, options, done.stderr)
        if as_json:
            fit = json.loads(done.stdout)
            nothing = fit["verdict"] == "not identifiable" or fit["chosen"] is None
            assert (done.returncode == 5) == nothing, (seed, options)
        elif done.returncode == 0:
            assert "±" in done.stdout or "within" in done.stdout, (seed, options)


def some_models(rng: np.random.Generator) -> list[str]:
    """Candidates from all models and sums of the ladder, or the automatic choice."""
    if rng.random() < 0.2:
        return []
    names = sorted({*MODELS, *CANDIDATES})
    return ["--models", ",".join(rng.choice(names, rng.integers(1, 3), replace=False))]


def table(rng: np.random.Generator) -> str:
    """CSV of one to twelve rows with extreme values, with u or without."""
    rows = {
        (theta_i, sign * theta_r, dphi)
        for theta_i, theta_r, sign, dphi in zip(
            rng.choice(ANGLES_DEG, 12) if rng.random() < 0.5 else [rng.choice(ANGLES_DEG)] * 12,
            rng.choice(ANGLES_DEG, 12),
            rng.choice([-1.0, 1.0], 12),
            rng.choice([0.0, 37.0, 180.0], 12) if rng.random() < 0.3 else [0.0] * 12,
            strict=True,
        )
    }
    angles = sorted(rows)[: rng.choice([1, 2, 3, 5, 8, 12])]
    brdf = values(rng, len(angles))
    u = uncertainties(rng, len(angles)) if rng.random() < 0.5 else None
    lines = [HEADER + (",u_brdf" if u is not None else "")]
    for n, (theta_i, theta_r, dphi) in enumerate(angles):
        end = f",{u[n]!r}" if u is not None else ""
        lines.append(f"{theta_i},{theta_r},{dphi},{brdf[n]!r}{end}")
    return "\n".join(lines) + "\n"


def values(rng: np.random.Generator, n: int) -> list[float]:
    """BRDF of n rows in 1/sr: constant, rounded, noise about zero, or over hundreds of decades."""
    kinds: tuple[FloatArray, ...] = (
        np.full(n, rng.choice([0.0, 0.2, 1 / np.pi, 1e-300, 1e-16, 1e-9, 1e15, -1.0])),
        np.round(rng.normal(0.2, 0.01, n), 2),
        rng.normal(0.2, 0.01, n),
        rng.normal(0.0, 10.0 ** rng.uniform(-10, 1), n),
        10.0 ** rng.uniform(-6, 3, n),
        10.0 ** rng.uniform(-300, 15, n) * rng.choice([1, 1, 1, -1], n),
        rng.choice([0.0, 1e-300, 0.2, 1.0, 1e15, -1e15], n),
    )
    return [float(value) for value in kinds[rng.integers(len(kinds))]]


def uncertainties(rng: np.random.Generator, n: int) -> list[float]:
    """u of n values in 1/sr, alike or not, within the limits of the table."""
    alike = rng.random() < 0.5
    powers = np.full(n, rng.uniform(-15, 15)) if alike else rng.choice([-15, -6, -2, 15], n)
    return [float(u) for u in np.clip(10.0**powers, 1e-15, 1e15)]
