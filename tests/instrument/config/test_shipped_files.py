"""Shipped configuration files load on every rig and agree with the paper."""

from pathlib import Path

import pytest

from instrument.config.load import Loaded, load_protocol, load_rig
from instrument.config.protocol import angles_deg
from tests.support.paths import CONFIGS

PROTOCOLS = sorted((CONFIGS / "protocols").glob("*.yaml"))
RIGS = sorted((CONFIGS / "rigs").glob("*.yaml"))


def name(path: Path) -> str:
    return path.stem


def protocol(stem: str) -> Loaded:
    return load_protocol(CONFIGS / "protocols" / f"{stem}.yaml")


def test_all_configuration_files_are_in_the_two_folders() -> None:
    assert sorted(CONFIGS.rglob("*.y*ml")) == sorted(PROTOCOLS + RIGS)
    assert PROTOCOLS
    assert RIGS


@pytest.mark.parametrize("path", RIGS, ids=name)
def test_a_rig_loads_and_is_named_like_its_file(path: Path) -> None:
    assert load_rig(path).name == path.stem


@pytest.mark.parametrize("path", PROTOCOLS, ids=name)
def test_a_protocol_loads_and_is_named_like_its_file(path: Path) -> None:
    assert load_protocol(path).protocol.name == path.stem


@pytest.mark.parametrize("rig", RIGS, ids=name)
@pytest.mark.parametrize("path", PROTOCOLS, ids=name)
def test_a_protocol_loads_on_every_simulated_rig(path: Path, rig: Path) -> None:
    if load_rig(rig).simulated:
        assert load_protocol(path, rig).rig_path == rig


# Oren and Nayar 1995, figures 16 to 22: albedo, sigma in degrees, k_s/k_d.
PUBLISHED = {
    "plaster_a": (0.90, 30.0, None),
    "sandpaper_b": (0.80, 40.0, None),
    "sand_c": (0.80, 35.0, None),
    "sand_c_out_of_plane": (0.80, 35.0, None),
    "foam_d": (0.80, 20.0, 0.019),
    "towel_e": (0.75, 42.0, 0.085),
    "shavings_f": (0.70, 26.0, 0.043),
}


@pytest.mark.parametrize("stem", PUBLISHED)
def test_a_sample_of_the_paper_has_the_published_parameters(stem: str) -> None:
    albedo, sigma_deg, ratio = PUBLISHED[stem]
    sample = protocol(stem).protocol.simulated_sample
    assert sample is not None
    wanted = {"albedo": albedo, "sigma_deg": sigma_deg}
    if ratio is not None:
        wanted["ks"] = pytest.approx(4 * ratio)  # the paper's lobe lacks our factor 1/4
    assert sample.parameters == wanted
    assert ("torrance_sparrow" in sample.model) == (ratio is not None)


@pytest.mark.parametrize("stem", sorted(set(PUBLISHED) - {"sand_c_out_of_plane"}))
def test_the_papers_incidences_in_plane(stem: str) -> None:
    (sweep,) = protocol(stem).protocol.sweeps
    assert angles_deg(sweep["theta_i_deg"]).tolist() == [30.0, 45.0, 60.0]
    assert angles_deg(sweep["dphi_deg"]).tolist() == [0.0]
    assert angles_deg(sweep["theta_r_deg"]).tolist() == list(range(-75, 80, 5))


def test_the_papers_incidences_out_of_plane() -> None:
    lamps = [
        (*angles_deg(sweep["theta_i_deg"]), *angles_deg(sweep["dphi_deg"]))
        for sweep in protocol("sand_c_out_of_plane").protocol.sweeps
    ]
    assert lamps == [(60.0, 45.0), (75.0, 60.0)]  # figure 19


def test_the_papers_rig() -> None:
    rig = load_rig(CONFIGS / "rigs" / "paper_1995.yaml")
    assert rig.beam_length_mm == pytest.approx(6 * 304.8)  # six feet
    assert (rig.camera.width_px, rig.camera.height_px) == (512, 480)
    assert (rig.source_solid_angle_sr, rig.receiver_solid_angle_sr) == (0.003, 0.0009)
    assert [rig.axes[axis].driver for axis in ("theta_i", "dphi", "theta_r")] == [
        "hand",
        "hand",
        "simulated",
    ]
    assert rig.lamp.darkened_by == "hand"
