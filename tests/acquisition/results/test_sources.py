"""Sources of `gonio fit`: runs, tables and databases."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.engine.engine import Engine
from acquisition.engine.resume import Progress
from acquisition.plan.plan import Step, make_plan
from acquisition.results.reduction import reduced_run
from acquisition.results.run_folder import load_run_inputs, run_meta, write_run_inputs
from acquisition.results.sources import Wanted, read_source
from acquisition.rig import open_devices
from analysis.choice.notes import NoteCode
from analysis.exchange.dense import merl
from instrument.config.load import Loaded, load_protocol
from instrument.errors import AllFlagged, InputError
from instrument.record.record import Record
from tests.support.analysis import curet_texts
from tests.support.scans import changed, small_demo


class StoppedError(Exception):
    """Ends a scan after a step."""


@pytest.fixture(scope="module")
def resumed_with_a_darker_lamp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run's folder; the lamp lost 20 % of its light while the scan was interrupted."""
    folder = tmp_path_factory.mktemp("jump")
    loaded = load_protocol(small_demo(folder))
    white = loaded.rig.lamp.white_electrons_per_s
    lamp = loaded.rig.lamp.model_copy(update={"white_electrons_per_s": 0.8 * white})
    plan = make_plan(loaded)

    def stop(step: Step) -> None:
        if step.index == 12 and not record.checks():
            raise StoppedError

    def measure(rig: Loaded, progress: Progress | None) -> None:
        devices = open_devices(rig)
        Engine(rig.protocol, rig.rig, devices, record, stop).run(plan, progress)

    with Record.create(folder / "run", run_meta(loaded, plan)) as record:
        write_run_inputs(record)
        with pytest.raises(StoppedError):
            measure(loaded, None)
        measure(changed(loaded, rig={"lamp": lamp}), Progress.of(record))
        assert [check.jumped for check in record.checks()] == [True]
    return folder / "run"


def test_a_run_is_fitted_with_the_lamp_s_jumps_taken_out(resumed_with_a_darker_lamp: Path) -> None:
    folder = resumed_with_a_darker_lamp
    source = read_source(folder, Wanted())
    with Record.open(folder) as record:
        reduced = reduced_run(record, load_run_inputs(record))
    assert source.measurements.brdf.tolist() == reduced.brdf[reduced.valid].tolist()


def test_a_table_of_flagged_points_alone_has_nothing_to_fit(tmp_path: Path) -> None:
    path = tmp_path / "dark.csv"
    path.write_text("theta_i_deg,theta_r_deg,dphi_deg,brdf,flags\n30,0,0,,no signal\n")
    with pytest.raises(AllFlagged, match="all 1 points are flagged"):
        read_source(path, Wanted())


@pytest.mark.parametrize("name", ["u_brdf_percent", "u_rel", "std", "Uncertainty", "σ_brdf"])
def test_a_column_of_u_that_is_not_read_is_named(name: str, tmp_path: Path) -> None:
    """A u in another unit must not be lost in silence."""
    path, rows = tmp_path / "table.csv", "30,0,0,0.2,1\n30,9,0,0.2,1\n"
    path.write_text(f"theta_i_deg,theta_r_deg,dphi_deg,brdf,{name}\n{rows}")
    (note,) = (n for n in read_source(path, Wanted()).notes if n.code == NoteCode.IGNORED_U)
    assert note.text.startswith(f"not read: {name}; an uncertainty is read from u_brdf, in 1/sr")


@pytest.mark.parametrize("name", ["u_brdf", "sample", "temperature", "unit"])
def test_other_columns_are_ignored(name: str, tmp_path: Path) -> None:
    path, rows = tmp_path / "table.csv", "30,0,0,0.2,1\n30,9,0,0.2,1\n"
    path.write_text(f"theta_i_deg,theta_r_deg,dphi_deg,brdf,{name}\n{rows}")
    codes = {note.code for note in read_source(path, Wanted()).notes}
    assert NoteCode.IGNORED_U not in codes


def test_repeats_are_averaged_on_request(tmp_path: Path) -> None:
    path, rows = tmp_path / "table.csv", "30,0,0,0.2,.01\n30,9,0,0.2,.01\n30,9,0,0.3,.01\n"
    path.write_text(f"theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf\n{rows}")
    source = read_source(path, Wanted(repeats="mean"))
    assert source.measurements.brdf.tolist() == pytest.approx([0.2, 0.25])
    (note,) = (n for n in source.notes if n.code == NoteCode.REPEATS)
    assert note.text.startswith("1 of 2 geometries are means of 2 repeats, which scatter by 7.1 ti")
    assert note.text.endswith("the u is too small for what changes between repeats")


def test_conventions_of_a_table_are_taken_from_its_user(tmp_path: Path) -> None:
    path = tmp_path / "other.csv"
    path.write_text(
        "theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf\n30,60,180,0.1,0.01\n30,-60,0,.2,.01\n"
    )
    wanted = Wanted(cosine_corrected=True, mirror_azimuth=True, repeats="mean")
    source = read_source(path, wanted)
    m = source.measurements
    np.testing.assert_allclose(m.brdf, [0.2, 0.4], rtol=1e-12)
    assert m.u_random is not None
    np.testing.assert_allclose(m.u_random, [0.02, 0.02], rtol=1e-12)
    np.testing.assert_allclose(m.geometry.cos_dphi, 1.0)
    said = [note.text for note in source.notes if note.code == NoteCode.RESTATED]
    assert ["--cosine-corrected" in said[0], "--mirror-azimuth" in said[1]] == [True, True]


def test_a_grazing_value_with_a_cosine_is_refused_unless_left_out(tmp_path: Path) -> None:
    path = tmp_path / "other.csv"
    path.write_text("theta_i_deg,theta_r_deg,dphi_deg,brdf\n30,90,0,0\n30,0,0,.2\n")
    with pytest.raises(InputError, match=r"--cosine-corrected: 1 of 2 .*--max-theta-deg 89"):
        read_source(path, Wanted(cosine_corrected=True))
    kept = read_source(path, Wanted(cosine_corrected=True, max_theta_deg=89.0))
    assert kept.measurements.brdf.tolist() == [0.2]


@pytest.mark.parametrize("option", ["cosine_corrected", "mirror_azimuth"])
def test_a_run_has_its_own_conventions(resumed_with_a_darker_lamp: Path, option: str) -> None:
    with pytest.raises(InputError, match=f"--{option.replace('_', '-')}: for a run"):
        read_source(resumed_with_a_darker_lamp, Wanted(**{option: True}))


def test_a_folder_of_the_curet_database_is_recognised(tmp_path: Path) -> None:
    (tmp_path / "table.txt").write_text(curet_texts.TABLE)
    (tmp_path / "abrdf.dat").write_text(curet_texts.VALUES)
    assert read_source(tmp_path, Wanted(sample=1)).measurements.size == 3
    with pytest.raises(InputError, match=r"--sample: missing for the format curet"):
        read_source(tmp_path, Wanted())


def test_a_merl_file_is_recognised_and_what_is_taken_from_it_named(tmp_path: Path) -> None:
    path = tmp_path / "matte.binary"
    cells = np.full((3, 90, 90, 180), 0.1) / np.reshape(merl.SCALES, (3, 1, 1, 1))
    path.write_bytes(np.array(merl.SHAPE, dtype="<i4").tobytes() + cells.astype("<f8").tobytes())
    source = read_source(path, Wanted(max_theta_deg=70.0))
    np.testing.assert_allclose(source.measurements.brdf, 0.1, rtol=1e-12)
    assert np.max(np.abs(source.measurements.theta_r_deg)) == 70.0
    said = [note.text for note in source.notes if note.code == NoteCode.DIRECTIONS]
    assert "directions of a MERL file, interpolated between its cells" in said[0]
    with pytest.raises(InputError, match="for a merl, whose conventions are known"):
        read_source(path, Wanted(mirror_azimuth=True))


def test_a_folder_of_pab_files_is_one_table(tmp_path: Path) -> None:
    """One file for each incidence, as `gonio export` and the instrument write them."""
    for n, theta_i in enumerate((30, 50)):
        rows = "\n".join(f"{theta_r} 180 0.{n + 1}" for theta_r in range(0, 80, 10))
        head = f"#format: theta phi BSDF\n#intheta {theta_i}\n#inphi 0\n#upphi 0\n"
        (tmp_path / f"scan_{n}.pab").write_text(f"{head}{rows}\n")
    (tmp_path / "scan.u.csv").write_text("theta_i_deg,u_brdf\n30,0.1\n")
    m = read_source(tmp_path, Wanted()).measurements
    assert sorted(set(m.theta_i_deg.tolist())) == [30.0, 50.0]
    np.testing.assert_allclose(m.brdf, np.where(m.theta_i_deg == 30, 0.1, 0.2))
    (tmp_path / "again.pab").write_text((tmp_path / "scan_0.pab").read_text())
    with pytest.raises(InputError, match="8 directions stand in it more than once"):
        read_source(tmp_path, Wanted())
