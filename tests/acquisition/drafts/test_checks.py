"""Drafts of rig files and protocols: whatever is answered, the file loads and plans."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from acquisition.drafts.checks import protocol_draft, rig_draft, scan_of
from acquisition.drafts.interview import Draft, Interview
from acquisition.drafts.rig_questions import Bench
from acquisition.plan.plan import Plan, make_plan
from acquisition.results.model_check import check_model
from drivers.discovery import FoundPort
from instrument.config.load import load_protocol, load_rig
from instrument.errors import InputError
from tests.support.drafts.benches import CAMERA, PORTS, Typist, found_camera, full_bench


def written_rig(bench: Bench, folder: Path, **given: str) -> Path:
    """File of a rig for which nobody is asked; dots in keys are double underscores."""
    answers = {key.replace("__", "."): value for key, value in given.items()}
    text = Interview(given=answers).text_of(rig_draft(bench, folder))
    path = bench.folder / "bench.yaml"
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Draft, Draft]:
    """Drafts of a real rig and of a scan on a simulated one, whose defaults stay checked."""
    folder = tmp_path_factory.mktemp("kept")
    path = written_rig(Bench(folder=folder, name="bench"), folder)
    scan = scan_of("scan", load_rig(path), path, folder)
    (folder / "scratch").mkdir()
    return rig_draft(full_bench(folder), folder / "scratch"), protocol_draft(scan, folder)


def written_protocol(rig_path: Path, folder: Path, interview: Interview) -> Path:
    path = rig_path.parent / "scan.yaml"
    scan = scan_of("scan", load_rig(rig_path), rig_path, path.parent)
    path.write_text(interview.text_of(protocol_draft(scan, folder)))
    return path


def planned(path: Path) -> Plan:
    return make_plan(load_protocol(path, check_model=check_model))


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    (tmp_path / "scratch").mkdir()
    return tmp_path / "scratch"


@pytest.mark.slow
def test_any_answers_give_a_pair_of_files_that_loads_and_plans(
    slow: bool, tmp_path: Path, scratch: Path
) -> None:
    """With and without devices found; and every answer that is refused has its reason."""
    refused = []
    for seed in range(300 if slow else 3):
        typist = Typist(seed)
        person = Interview(given={}, ask=typist.ask, say=typist.say)
        bench = full_bench(tmp_path) if seed % 2 else Bench(folder=tmp_path, name="bench")
        rig_path = tmp_path / "bench.yaml"
        rig_path.write_text(person.text_of(rig_draft(bench, scratch)))
        assert planned(written_protocol(rig_path, scratch, person)).points, seed
        refused += typist.refused
    assert len(refused) >= 5
    assert all(reason and str(scratch) not in reason for _, reason in refused)
    named = [r for _, r in refused if re.search(r"; allowed:|allowed by|past the limits", r)]
    assert len(named) >= 0.8 * len(refused), refused  # the others: the way of a move is not clear


@pytest.mark.parametrize("found", [True, False])
def test_the_defaults_make_a_pair_that_plans(found: bool, tmp_path: Path, scratch: Path) -> None:
    bench = full_bench(tmp_path) if found else Bench(folder=tmp_path, name="bench")
    given = {"theta_r__driver": "newport"} if found else {}
    rig = load_rig(path := written_rig(bench, scratch, **given))
    assert rig.kind == ("real" if found else "simulated")
    assert planned(written_protocol(path, scratch, Interview(given={}))).points


def test_a_real_rig_holds_what_was_found(tmp_path: Path, scratch: Path) -> None:
    path = written_rig(
        full_bench(tmp_path), scratch, theta_i__driver="zaber", theta_i__port="1",
        theta_i__microsteps_per_deg="100", dphi__driver="newport", dphi__port="2",
        theta_r__driver="newport",
    )  # fmt: skip
    rig = yaml.safe_load(path.read_text())
    assert rig["camera"]["device"] == CAMERA
    assert (rig["camera"]["pixel_format"], rig["camera"]["gain"]) == ("Y16", 100)
    assert (rig["camera"]["min_exposure_s"], rig["camera"]["max_exposure_s"]) == (0.0001, 0.5)
    assert rig["axes"]["theta_i"]["port"] == PORTS[0]
    # Two motors on the port whose controller answered: they have different addresses.
    motors = [(rig["axes"][n]["port"], rig["axes"][n]["address"]) for n in ("dphi", "theta_r")]
    assert motors == [(PORTS[1], 1), (PORTS[1], 2)]
    assert "\x1b" not in path.read_text()


@pytest.mark.parametrize(
    ("key", "answer", "reason"),
    [
        ("camera", "webcam", "'webcam'; allowed: the number of a camera, simulated, or a path"),
        ("camera", "emulated", "allowed: the number of a camera, simulated, or a path"),
        ("camera.size", "640 x 480 x 3", "allowed: width x height, each from 16 to 16384"),
        ("camera.bit_depth", "8", "allowed: a whole number from 9 to 16"),
        ("theta_r.min_deg", "90", "past the limits of axis theta_r"),  # no view is left
        ("theta_r.max_deg", "-100", "less than max_deg"),
        ("theta_i.driver", "motor", "allowed: hand or newport or zaber or oriental"),
        ("lens_diameter_mm", "5000", "receiver_solid_angle_sr: .*; allowed: .*from 0 to 1"),
        ("calibration", "none.npz", r"none\.npz: cannot be read"),
    ],
)
def test_a_wrong_answer_about_a_rig_is_named(
    key: str, answer: str, reason: str, kept: tuple[Draft, Draft]
) -> None:
    with pytest.raises(InputError, match=f"--set {key}: .*{reason}"):
        Interview(given={key: answer}).text_of(kept[0])


@pytest.mark.parametrize(
    ("key", "answer", "reason"),
    [
        ("theta_i_deg", "30 86", "86 deg is past the limits of axis theta_i; allowed: -1 to 85"),
        ("theta_i_deg", "30 30", "30 deg is already in"),
        ("dphi_deg", "-90", "-90 deg is past the limits of axis dphi"),
        ("theta_r_start_deg", "-89", "-89 deg is past the limits of axis theta_r"),
        ("theta_r_num", "1", "1; allowed: 2 or more from -75 to 75"),
        ("window_width_mm", "60", "60 mm is larger than the sample; allowed: at most 50.8 mm"),
        ("u_reflectance", "0.6", "less than half of reflectance"),
        ("reference_theta_r_deg", "30", "30 deg is hidden by the lamp at theta_i 30 deg"),
        ("model", "phong", "allowed: lambert or"),
    ],
)
def test_a_wrong_answer_about_a_scan_is_named(
    key: str, answer: str, reason: str, kept: tuple[Draft, Draft]
) -> None:
    with pytest.raises(InputError, match=f"--set {key}: .*{reason}"):
        Interview(given={key: answer}).text_of(kept[1])


def test_a_port_that_nobody_found_and_a_gear_are_no_defaults(tmp_path: Path, scratch: Path) -> None:
    alone = Bench(folder=tmp_path, name="bench", cameras=(found_camera(),))
    with pytest.raises(InputError, match=r"theta_i\.port .*no serial port was found.*--set"):
        written_rig(alone, scratch, theta_i__driver="newport")
    with pytest.raises(InputError, match=r"steps_per_deg .*turns the stage too far.*--set"):
        written_rig(alone, scratch, theta_i__driver="oriental", theta_i__port="tcp://10.0.0.2:502")


def test_a_controller_that_answered_is_the_default(tmp_path: Path, scratch: Path) -> None:
    port = FoundPort(path=PORTS[0], text="x", answer="'1VE' when asked as Newport CONEX-CC")
    bench = Bench(folder=tmp_path, name="bench", cameras=(found_camera(),), ports=(port,))
    axes = yaml.safe_load(written_rig(bench, scratch).read_text())["axes"]
    assert {name: axis["driver"] for name, axis in axes.items()} == {
        "theta_i": "hand", "dphi": "hand", "theta_r": "newport"
    }  # fmt: skip
    assert (axes["theta_r"]["port"], axes["theta_r"]["model"]) == (PORTS[0], "CONEX-CC")


def test_a_camera_without_a_usable_format_is_not_offered(tmp_path: Path, scratch: Path) -> None:
    colour = found_camera(formats={"MJPG": ("640 x 480",)})
    path = written_rig(Bench(folder=tmp_path, name="bench", cameras=(colour,)), scratch)
    assert load_rig(path).simulated


def test_yuyv_of_limited_range_has_its_black_and_white(tmp_path: Path, scratch: Path) -> None:
    camera = found_camera(formats={"YUYV": ("640 x 480",)}, limited_range=True)
    path = written_rig(Bench(folder=tmp_path, name="bench", cameras=(camera,)), scratch)
    assert (load_rig(path).camera.max_dn, load_rig(path).camera.black_level_dn) == (235, 16.0)
