"""Angles in radians are recognised, and sound tables, however small their angles, are not.

False alarms: none in 400 sound tables.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.choice.checks.angle_units import angle_unit_text
from analysis.data.measurements import Measurements
from tests.support.analysis.table_faults import in_radians, matt_table


def test_sound_tables_give_no_alarm() -> None:
    rng = np.random.default_rng(3)
    for n in range(400):
        count = int(rng.integers(4, 80))
        largest = rng.choice([1.0, 1.5, 3.0, 30.0, 80.0])
        views = rng.uniform(-largest, largest, count)
        if n % 3:  # round angles, as a plan has them
            step = rng.choice([0.05, 0.1, 0.25, 0.5, 1.0, 2.5])
            views = np.clip(np.round(views / step) * step, -largest, largest)
        dphi = rng.choice([0.0, 5.0, 90.0, 180.0]) if n % 2 else rng.uniform(0, 360, count)
        m = Measurements.bare(rng.choice([0.0, 0.5, 1.0, 30.0]), views, dphi, 1.0)
        assert angle_unit_text(m) == "", n


@pytest.mark.parametrize("decimals", [3, 4, 7])
def test_a_table_in_radians_is_found(decimals: int) -> None:
    for seed in range(20):
        m = in_radians(matt_table(seed, incidences=1 + seed % 3).measurements, decimals)
        text = angle_unit_text(m)
        assert "angles in radians?" in text
        assert "75 degrees" in text


def test_dphi_alone_in_radians_is_found() -> None:
    m = matt_table(1).measurements
    dphi = np.where(m.theta_r_deg < 0, 3.1416, 0.0)
    text = angle_unit_text(replace(m, theta_r_deg=np.abs(m.theta_r_deg), dphi_deg=dphi))
    assert "dphi in radians?" in text
    assert "180 degrees" in text
