"""MERL files, read back by an independent reader."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from analysis.exchange.dense import merl
from analysis.exchange.exported import Export
from instrument.errors import InputError
from instrument.geometry import Geometry
from tests.support.exchange.fitted_models import explained_by, fitted
from tests.support.exchange.merl_reader import MerlFile
from tests.support.exchange.random_tables import KINDS, random_export, relative

SWEEPS = random_export(KINDS.index("whole sweeps"))


@cache
def _written(name: str) -> tuple[MerlFile, dict[str, object]]:
    export = explained_by(fitted(name), SWEEPS)
    (main, content), (side, text) = merl.files(export, "mine")
    assert (main, side) == ("mine.binary", "mine.merl.json")
    return MerlFile(content), json.loads(text)


@pytest.mark.parametrize("name", ["lambert", "torrance_sparrow", "eon+ggx"])
def test_a_reader_finds_the_models_value_in_the_cell_of_two_directions(name: str) -> None:
    """To within the width of a cell: the value is that at its lower edge."""
    file, model = _written(name)[0], fitted(name)
    rng = np.random.default_rng(3)
    theta_i, theta_r = rng.uniform(5, 75, (2, 300))
    phi_i, phi_r = rng.uniform(0, 360, (2, 300))
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=phi_r - phi_i)
    angles = np.radians(np.stack([theta_i, phi_i, theta_r, phi_r], axis=1))
    read = np.array([file.at(*row) for row in angles.tolist()])
    assert np.allclose(read, read[:, :1], rtol=1e-12)
    off = np.abs(read[:, 0] / model.brdf(geometry) - 1)
    assert np.median(off) < 0.03
    assert np.max(off) < 0.3
    if name == "lambert":
        assert np.max(off) < 1e-12


def test_at_a_cells_edge_the_value_is_exact() -> None:
    file, model = _written("torrance_sparrow")[0], fitted("torrance_sparrow")
    rng = np.random.default_rng(5)
    for i, j, k in rng.integers([0, 0, 0], [60, 40, 180], (200, 3)).tolist():
        edges = (math.radians(i * i / 90), math.radians(j), math.radians(k))
        to_lamp, to_camera = merl.directions(*(np.array(a) for a in edges))
        if min(to_lamp[2], to_camera[2]) < 0.02:
            continue
        geometry = Geometry.from_directions(to_lamp, to_camera)
        # A hair inside the cell, so that rounding does not choose its neighbour.
        found = file.cell(*(a + 1e-9 for a in edges))
        assert np.allclose(found, model.brdf(geometry), rtol=1e-9)


def test_cells_without_a_value_are_negative_and_counted() -> None:
    file, side = _written("oren_nayar")
    cells = side["cells"]
    assert isinstance(cells, dict)
    empty = int(np.sum(file.planes[0] < 0))
    assert empty == cells["below_horizon"] + cells["model_not_valid"]
    assert cells["model_not_valid"] > 0
    assert np.all((file.planes < 0) == (file.planes[:1] < 0))
    assert cells["all"] == file.planes.shape[1]


def test_the_side_file_says_that_all_is_modelled() -> None:
    _, side = _written("oren_nayar")
    assert side["origin"] == "modelled"
    assert side["model"] == "oren_nayar"
    assert side["verdict"] == "adequate"
    assert side["parameters"]["sigma_deg"] == {"value": 20, "u": None, "unit": "degrees"}
    assert set(side["facts"]) == set(SWEEPS.facts)


def _anisotropic() -> Export:
    """Two points at mirrored azimuths of which one is brighter by many u."""
    model = fitted("lambert")
    geometry = Geometry.from_degrees(theta_i=[30, 30, 30], theta_r=[40, 40, 10], dphi=[60, 300, 0])
    brdf = np.array([0.159, 0.165, 0.159])
    table = replace(SWEEPS.table, geometry=geometry, brdf=brdf, u_brdf=np.full(3, 1e-4))
    return replace(SWEEPS, table=table, model=model)


@pytest.mark.parametrize(
    ("export", "words"),
    [
        (relative(explained_by(fitted("lambert"), SWEEPS)), "relative"),
        (SWEEPS, "no model was fitted"),
        (_anisotropic(), "holds isotropic BRDF"),
        (
            explained_by(fitted("oren_nayar_qualitative", sigma_deg=50), random_export(2)),
            "not valid at",
        ),
    ],
)
def test_what_no_model_can_fill_is_refused(export: Export, words: str) -> None:
    with pytest.raises(InputError, match=words):
        list(merl.files(export, "mine"))


def test_mirrored_azimuths_that_agree_within_u_pass() -> None:
    export = _anisotropic()
    table = replace(export.table, u_brdf=np.full(3, 2e-3))
    assert len(list(merl.files(replace(export, table=table), "mine"))) == 2
