"""Fit of corners that were computed: values within u, u as large as the errors, outliers out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.calibration.geometry.geometry_fit import fit_geometry
from analysis.calibration.geometry.parameters import NAMES
from tests.support.calibration.board_pictures import NOMINAL, Drawn, drawn

FOUND = [name for name in NAMES if not name.startswith("centre")]
"""The middle of a distortion of nearly nothing is a product: its u is that of a linear fit."""


def pulls(own: Drawn) -> list[float]:
    fit = fit_geometry(own.corners, NOMINAL, 0.02)
    errors = {name: fit.values[name].value - own.truth[name] for name in NAMES}
    errors["turned_turn_deg"] = (errors["turned_turn_deg"] + 180) % 360 - 180
    return [errors[name] / fit.values[name].u for name in FOUND]


def test_drawn_geometries_are_found_within_their_u(slow: bool) -> None:
    """With noise of corners, wobble of pictures and errors of the axis."""
    count = 60 if slow else 2
    found = np.array([pulls(drawn(seed)) for seed in range(count)])
    assert np.max(np.abs(found)) < 4.5
    assert np.sqrt(np.mean(found**2)) < (1.15 if slow else 1.6)
    if slow:
        assert np.sqrt(np.mean(found**2)) > 0.85
        spread = dict(zip(FOUND, np.sqrt(np.mean(found**2, axis=0)).tolist(), strict=True))
        assert min(spread.values()) > 0.4, spread
        assert max(spread.values()) < 1.35, spread


def test_a_few_corners_far_off_change_nothing() -> None:
    own = drawn(5)
    pixels = own.corners.pixels.copy()
    wrong = np.arange(7, len(pixels), 40)
    pixels[wrong] += [3.0, -2.0]
    fit = fit_geometry(replace(own.corners, pixels=pixels), NOMINAL, 0.02)
    assert not fit.used[wrong].any()
    assert fit.used.sum() >= len(pixels) - len(wrong) - 2
    assert abs(fit.values["zero_deg"].value - own.truth["zero_deg"]) < 4 * fit.values["zero_deg"].u


def test_an_axis_that_errs_more_than_stated_enlarges_u() -> None:
    own = drawn(6, axis_deg=0.2)
    fit = fit_geometry(own.corners, NOMINAL, 0.02)
    assert fit.spread["axis"] == pytest.approx(0.2, rel=0.6)
    assert fit.values["zero_deg"].u > 0.02
