"""Look-up tables of OpenMATERIAL 3D, read by the rules of its schema."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from analysis.exchange.exported import Export
from analysis.exchange.tables.openmaterial import files
from instrument.errors import InputError
from instrument.geometry import Geometry
from tests.support.exchange.openmaterial_rules import checked
from tests.support.exchange.random_tables import KINDS, random_export, relative


def _with(export: Export, **facts: str) -> Export:
    return replace(export, facts={**export.facts, **facts})


@pytest.mark.parametrize("seed", range(4 * len(KINDS)))
def test_a_table_keeps_every_angle_and_value(seed: int) -> None:
    export = _with(random_export(seed), wavelength_nm="632.8")
    (main, content), (side, text) = files(export, "mine_brdf")
    assert (main, side) == ("mine_brdf.xompt", "mine_brdf.json")
    brdf, table = checked(content)["brdf"], export.table
    *angles, values = np.array(brdf["lookupTable"], dtype=np.float64)[:, 1:].T
    exact = json.loads(text)
    known = np.array(exact["u_brdf_per_sr"], dtype=np.float64)
    read = np.array([*np.degrees(angles), exact["brdf_per_sr"], known])
    g = table.geometry
    written = np.array([g.theta_i_deg, g.theta_r_deg, g.dphi_deg, table.brdf, table.u_brdf])
    written = written[:, np.lexsort(written[3::-1])]
    assert np.allclose(read[:3], written[:3], rtol=0, atol=1e-9)
    assert np.array_equal(read[3:], written[3:], equal_nan=True)
    assert np.array_equal(values, np.where(written[3] >= 0, written[3], np.nan), equal_nan=True)
    assert brdf["wavelengths"] == pytest.approx([632.8e-9])
    solid = [angle["solidAngle"] for angle in brdf.get("receiverSolidAngles", [])]
    assert solid == ([] if table.receiver_sr is None else [table.receiver_sr])


def test_angles_on_the_border_are_within_that_of_the_schema() -> None:
    geometry = Geometry.from_degrees(theta_i=[90, 10], theta_r=[10, 90], dphi=[180, 359.9999999])
    table = replace(
        random_export(0).table, geometry=geometry, brdf=np.ones(2), u_brdf=np.full(2, 0.1)
    )
    export = _with(replace(random_export(0), table=table), wavelength_nm="550")
    assert len(checked(next(files(export, "mine_brdf"))[1])["brdf"]["lookupTable"]) == 2


def test_sample_time_and_operator_stand_in_their_places() -> None:
    export = _with(
        random_export(0), sample="a\nplate", operator="Ann", wavelength_nm="550",
        measured_utc="2026-11-20T10:00:00+00:00 to 2026-11-20T10:30:00+00:00",
    )  # fmt: skip
    metadata = checked(next(files(export, "a_brdf"))[1])["metadata"]
    assert metadata["name"] == "a plate"
    assert metadata["authors"] == ["Ann"]
    assert metadata["creationDate"] == "20261120T103000Z"
    again = _with(export, measured_utc="later")
    other = checked(next(files(again, "b_brdf"))[1])["metadata"]
    assert other["uuid"] == metadata["uuid"]
    assert "creationDate" not in other


@pytest.mark.parametrize("wavelength", ["", "nm", "nan", "0.5", "1e9", "550,5"])
def test_a_run_without_a_wavelength_is_refused(wavelength: str) -> None:
    with pytest.raises(InputError, match="wavelength_nm"):
        list(files(_with(random_export(0), wavelength_nm=wavelength), "mine_brdf"))


def test_relative_values_and_other_names_are_refused() -> None:
    export = _with(random_export(0), wavelength_nm="550")
    with pytest.raises(InputError, match="relative"):
        list(files(relative(export), "mine_brdf"))
    with pytest.raises(InputError, match=r"write to mine_brdf\.xompt"):
        list(files(export, "mine"))
