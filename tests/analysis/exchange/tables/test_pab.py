"""pab-opto text: read back by an independent reader, by Radiance's own, and by the program's."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from analysis.exchange.exported import BrdfTable, Export
from analysis.exchange.tables import pab
from analysis.models import MODELS
from instrument.errors import InputError
from instrument.geometry import FloatArray, Geometry
from instrument.text.text_file import TextFile
from tests.support.exchange.pab_reader import read_pab
from tests.support.exchange.random_tables import random_export, relative

HEAD = "#format: theta phi BSDF\n#intheta 30\n#inphi 10\n"


def text_file(text: str) -> TextFile:
    return TextFile("mine.pab", text.split("\n"))


def pab_files(export: Export) -> dict[str, bytes]:
    return {name: content for name, content in pab.files(export, "mine") if name.endswith(".pab")}


@pytest.mark.parametrize("seed", range(40))
def test_another_reader_finds_the_values_as_measured(seed: int) -> None:
    export = random_export(seed)
    found = [read_pab(content) for content in pab_files(export).values()]
    assert all(file.kind == "BSDF" and file.theta_phi[1] == 0 for file in found)
    angles, brdf = export.table.geometry, export.table.brdf
    for file in found:
        points = angles.theta_i_deg == file.theta_phi[0]
        assert file.rows[:, 0].tolist() == angles.theta_r_deg[points].tolist()
        assert file.rows[:, 1].tolist() == angles.dphi_deg[points].tolist()
        assert file.rows[:, 2].tolist() == brdf[points].tolist()
    assert sum(len(file.rows) for file in found) == export.table.size


@pytest.mark.parametrize("seed", range(40))
def test_the_program_reads_its_own_files(seed: int) -> None:
    export = random_export(seed)
    texts = [text_file(content.decode()) for content in pab_files(export).values()]
    assert all(pab.is_pab(text) for text in texts)
    tables = [pab.read(text) for text in texts]
    written = export.table.geometry
    order = np.argsort([list(dict.fromkeys(written.theta_i_deg.tolist())).index(t)
                        for t in written.theta_i_deg.tolist()], kind="stable")  # fmt: skip
    assert _joined(tables, "brdf").tolist() == export.table.brdf[order].tolist()
    for name in ("theta_i_deg", "theta_r_deg", "dphi_deg"):
        read = np.concatenate([getattr(table.geometry, name) for table in tables])
        assert read.tolist() == getattr(written, name)[order].tolist()


def _joined(tables: list[BrdfTable], name: str) -> FloatArray:
    return np.concatenate([getattr(table, name) for table in tables])


def dense_export(model: str, name: str, **parameters: float) -> Export:
    """Export of a model in six incidences and all round."""
    i, r, dphi = np.meshgrid(
        [0.0, 15, 30, 45, 60, 75], np.arange(0.0, 86, 5), np.arange(0, 360, 15)
    )
    geometry = Geometry.from_degrees(theta_i=i.ravel(), theta_r=r.ravel(), dphi=dphi.ravel())
    brdf = MODELS[model].brdf(geometry, **parameters)
    table = BrdfTable(geometry=geometry, brdf=brdf, u_brdf=np.full(brdf.size, np.nan))
    return Export(table=table, own_table="", facts={"sample": name})


def test_radiance_makes_the_same_reflectance_of_it(tmp_path: Path) -> None:
    """pabopto2bsdf, bsdf2klems and checkBSDF; the lobe is where the program has it."""
    spec = find_spec("pyradiance")
    if spec is None or spec.origin is None:
        pytest.skip("pyradiance, a development extra, is not installed")
    name = 'he said "<&>"' + "µ" * 400
    export = dense_export("oren_nayar", name, albedo=0.6, sigma_deg=25.0)
    found = _through_radiance(Path(spec.origin).parent, tmp_path, export)
    angles = [(i, r, dphi) for i in (26, 52) for r in (13, 39, 65) for dphi in (0, 90, 180)]
    theirs = _values(found, angles)
    i, r, dphi = np.transpose(angles)
    geometry = Geometry.from_degrees(theta_i=i, theta_r=r, dphi=dphi)
    ours = MODELS["oren_nayar"].brdf(geometry, albedo=0.6, sigma_deg=25.0)
    # Its interpolation by Gaussian lobes is off by up to 27 %; a wrong side would be off by 50 %.
    np.testing.assert_allclose(theirs, ours, rtol=0.3)
    np.testing.assert_allclose(np.mean(theirs / ours), 1, atol=0.1)
    assert np.all(theirs[dphi == 0] > theirs[dphi == 180])


def _through_radiance(package: Path, folder: Path, export: Export) -> Path:
    """Return the XML of Radiance's tools for an export, checked by checkBSDF."""
    for name, content in pab_files(export).items():
        (folder / name).write_bytes(content)
    tools = {**os.environ, "PATH": f"{package / 'bin'}:{os.environ['PATH']}",
             "RAYPATH": f".:{package / 'lib'}"}  # fmt: skip

    def run(*command: str) -> bytes:
        done = subprocess.run(command, cwd=folder, env=tools, capture_output=True, check=True)
        assert b"bad incidence" not in done.stderr
        return done.stdout

    (folder / "x.sir").write_bytes(run("pabopto2bsdf", *pab_files(export)))
    (folder / "x.xml").write_bytes(run("bsdf2klems", "-h", "-n", "64", "x.sir"))
    checked = run("checkBSDF", "./x.xml").decode()
    assert "Interior Refl" in checked
    return folder / "x.xml"


def _values(xml: Path, angles: list[tuple[int, int, int]]) -> FloatArray:
    """BRDF (N,) in 1/sr by Radiance's loader, native code: in a process of its own."""
    script = (
        "import sys, json; from pyradiance import bsdf; f = bsdf.load_file(sys.argv[1]);"
        "print([float(bsdf.query(f, i, 0, r, dphi)[1]) for i, r, dphi in json.loads(sys.argv[2])])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, xml, json.dumps(angles)], capture_output=True, check=True
    )
    return np.array(json.loads(done.stdout))


def test_relative_values_are_refused() -> None:
    with pytest.raises(InputError, match=r"--format pab: .*1/sr.*white tile"):
        list(pab.files(relative(random_export(1)), "mine"))


def test_a_dsf_is_divided_by_its_cosine_and_the_azimuth_by_that_of_the_lamp() -> None:
    table = pab.read(text_file("#format: theta phi DSF\n#incident_angle 30 10\n60 190 0.25"))
    np.testing.assert_allclose(table.brdf, [0.5], rtol=1e-14)
    assert table.geometry.dphi_deg.tolist() == [180.0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + "10 0 inf", r"mine.pab:4:6: brdf: 'inf' is not finite; allowed: "),
        (HEAD + "100 0 1", r":4:1: theta: 100 deg; allowed: 0 to 90 deg, on the side of the inc"),
        (HEAD + "10 0 1 2", r":4:1: row: 4 numbers; allowed: 3"),
        (HEAD, r"no row of values; allowed: rows of theta phi BSDF"),
        (HEAD.replace("BSDF", "BTDF") + "1 2 3", r"#format: .*BTDF.*; allowed: BSDF, BRDF or DSF"),
        (HEAD.replace("#intheta 30\n", "") + "1 2 3", r"no #intheta; allowed: the incidence"),
        (HEAD.replace("30", "95") + "1 2 3", r":2:10: theta_i_deg: 95 deg; allowed: .* 0 to 90"),
        (HEAD + "#colorimetry: CIE-XYZ\n1 2 3", r"CIE-XYZ; allowed: CIE-Y"),
        (HEAD.replace("BSDF", "DSF") + "90 0 1", r":4:1: theta: 90 deg in a DSF; allowed: less"),
    ],
)
def test_a_bad_file_names_line_and_value(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        pab.read(text_file(text))
