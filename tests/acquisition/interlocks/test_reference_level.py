"""Tile readings: enough light, not more than white gives, and the cosine of the lamp's angle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from acquisition.interlocks.lamp_checks import UNPROVEN
from acquisition.interlocks.reference_level import angle_doubt, level_doubt, repeat_doubt
from acquisition.measure.drift import Drift
from acquisition.measure.placement import Placement
from acquisition.plan.plan import make_plan
from acquisition.results.reduction import Reduced, reduce
from instrument.config.load import Loaded
from instrument.config.protocol import References
from instrument.config.rig import Rig, SimulatedTile
from instrument.errors import Interlock
from instrument.record.reading import Reading
from instrument.record.record import Record
from sim.scene.scene import Scene
from tests.support.scans import changed, small_scan
from tests.support.white_tiles import table_text, tabled
from tests.support.whole_scans.lamp_faults import LampFault
from tests.support.whole_scans.stopped_scan import scan

RIGS = ["bench_12bit", "paper_1995"]


@cache
def rig_of(name: str) -> Rig:
    return small_scan(name).rig


def tile(rig_name: str, theta_i_deg: float, factor: float, block: int = 0) -> Reading:
    """Reading of a tile that gives `factor` times what the rig file lets expect of white."""
    rig = rig_of(rig_name)
    white = rig.lamp.white_electrons_per_s / rig.camera.electrons_per_dn
    signal = factor * white * 0.01 * np.cos(np.radians(theta_i_deg))
    return Reading(
        step=0, kind="tile", surface="white tile", theta_i_deg=theta_i_deg, dphi_deg=0.0,
        theta_r_deg=10.0, lamp_setting=0, block=block, signal_dn=float(signal), u_noise_dn=0.1,
        u_quantisation_dn=0.0, u_dark_dn=0.0, u_placement_dn=0.0, u_texture_dn=0.0,
        exposure_s=0.01, frames=4, window_pixels=100.0, saturated_pixels=0, peak_dn=1000.0,
        time_s=60.0 * block, free_s=60.0 * block, time_utc="", flags="",
    )  # fmt: skip


@pytest.mark.parametrize("rig_name", RIGS)
@pytest.mark.parametrize(
    ("factor", "refused"), [(1e-5, True), (0.2, False), (3.0, False), (30.0, True)]
)
def test_a_tile_shows_light_and_at_most_what_white_gives(
    rig_name: str, factor: float, refused: bool
) -> None:
    rig = rig_of(rig_name)
    assert bool(level_doubt(tile(rig_name, 45.0, factor), rig)) == refused
    sample = replace(tile(rig_name, 45.0, factor), kind="drift", surface="sample")
    assert bool(level_doubt(sample, rig)) == (refused and factor < 1)  # it may be glossy


@pytest.mark.parametrize("rig_name", RIGS)
@pytest.mark.parametrize("seed", range(12))
def test_tile_readings_follow_the_cosine_within_what_the_rig_file_allows(
    rig_name: str, seed: int
) -> None:
    """Random angles within u, heights within u, a tile of pressed PTFE, a drifting lamp."""
    random, rig = np.random.default_rng(seed), rig_of(rig_name)
    made = []
    for block, theta_i in enumerate(random.choice([0.0, 15.0, 30.0, 45.0, 60.0, 70.0], 4, False)):
        true = np.radians(theta_i + rig.axes.theta_i.u_deg * random.standard_normal())
        level = np.cos(true) / np.cos(np.radians(theta_i))
        placement = Placement(rig.u_placement_mm, theta_i, rig.lamp_distance_mm)
        level *= 1 + placement.u_irradiance * random.standard_normal()
        level *= 1 - 0.05 * random.uniform() * np.tan(true) / np.tan(np.radians(60.0))
        made.append(tile(rig_name, float(theta_i), float(level), block))
    drifts = {block: Drift((), np.nan) for block in range(4)}
    for n, reading in enumerate(made):
        assert not any(angle_doubt(reading, other, drifts, rig) for other in made[:n])


@pytest.mark.parametrize("rig_name", RIGS)
@pytest.mark.parametrize("off_deg", [-5.0, 5.0, 8.0])
@pytest.mark.parametrize("wrong", [0, 1])
def test_a_lamp_set_5_degrees_off_at_60_degrees_is_noticed(
    rig_name: str, off_deg: float, wrong: int
) -> None:
    rig, off = rig_of(rig_name), [0.0, 0.0]
    angles = [60.0, 30.0] if wrong == 0 else [30.0, 60.0]
    off[wrong] = off_deg
    made = [
        tile(rig_name, a, float(np.cos(np.radians(a + o)) / np.cos(np.radians(a))), n)
        for n, (a, o) in enumerate(zip(angles, off, strict=True))
    ]
    drifts = {block: Drift((), np.nan) for block in range(2)}
    assert angle_doubt(made[1], made[0], drifts, rig)


# Radiance factor of sintered PTFE, seen 10 deg off the normal on the lamp's side, over its 8 deg/
# hemispherical reflectance: the fit of Germer, Applied Optics 56 (2017) 9333, at 532 nm.
PTFE = {0.0: 1.0696, 15.0: 1.0642, 30.0: 1.0425, 45.0: 1.0103, 60.0: 0.9656, 70.0: 0.9161}


@pytest.mark.parametrize("rig_name", RIGS)
@pytest.mark.parametrize("blocks", [0, 1])
def test_sintered_ptfe_is_not_taken_for_a_wrong_angle(rig_name: str, blocks: int) -> None:
    rig, drifts = rig_of(rig_name), {block: Drift((), np.nan) for block in range(6)}
    made = [tile(rig_name, a, beta, n * blocks) for n, (a, beta) in enumerate(PTFE.items())]
    for n, reading in enumerate(made):
        assert not [t for other in made[:n] if (t := angle_doubt(reading, other, drifts, rig))]


def test_a_tile_follows_its_table_where_it_has_one(tmp_path: Path) -> None:
    """A tile that is far from white: only its table tells that the lamp stands right."""
    rig, drifts = rig_of("bench_12bit"), {0: Drift((), np.nan)}
    falling = SimulatedTile(falloff=0.5)
    known = tabled(table_text(falling, 0.0, 0.001), tmp_path)
    assert known.values is not None
    seen = [tile("bench_12bit", a, known.values.at(a, 10.0, 0.0).beta) for a in (30.0, 60.0)]
    assert angle_doubt(*seen, drifts, rig)
    assert not angle_doubt(*seen, drifts, rig, known)
    white = [tile("bench_12bit", angle, 1.0) for angle in (30.0, 60.0)]
    assert angle_doubt(*white, drifts, rig, known)
    assert not angle_doubt(*white, drifts, rig)


Undisturbed = Callable[..., Reduced]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Undisturbed:
    """Return values of a small scan without a fault, by rig and by `read_again`."""

    @cache
    def values(rig_name: str, *, read_again: bool = False) -> Reduced:
        loaded = _read_again(rig_name) if read_again else small_scan(rig_name)
        with Record.create(tmp_path_factory.mktemp(rig_name) / "run", {}) as record:
            scan(loaded, record)
            return reduce(record.readings(), loaded.protocol, record.checks())

    return values


@pytest.mark.parametrize("wrong_deg", [30.0, 60.0])
def test_a_lamp_set_by_hand_at_a_wrong_angle_stops_the_scan_and_all_of_it_is_measured_again(
    wrong_deg: float, record: Record, undisturbed: Undisturbed, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One of two settings is wrong, the tile at the second is read after its points."""
    loaded, good = small_scan("paper_1995"), undisturbed("paper_1995")
    off, real = {wrong_deg: 5.0 if wrong_deg > 45 else 16.0}, Scene.set_axis

    def set_axis(scene: Scene, axis: str, angle_deg: float) -> None:
        real(scene, axis, angle_deg)
        scene.true_deg[axis] += off.get(angle_deg, 0.0) if axis == "theta_i" else 0.0

    monkeypatch.setattr(Scene, "set_axis", set_axis)
    with pytest.raises(Interlock, match="lamp angle: white tile at theta_i 60 deg"):
        scan(loaded, record)
    found = reduce(record.readings(), loaded.protocol, record.checks())
    assert all(UNPROVEN in flags for flags in found.flags)
    off.clear()
    scan(loaded, record)
    found = reduce(record.readings(), loaded.protocol, record.checks())
    assert not any(found.flags)
    assert found.brdf == pytest.approx(good.brdf, rel=5e-3)


def test_a_tile_without_light_stops_the_scan_before_any_point(
    small: Loaded, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    LampFault(level=0.0).install(monkeypatch)
    with pytest.raises(Interlock, match="light: white tile at theta_i 30 deg"):
        scan(small, record)
    assert not record.readings()


def test_a_lamp_that_drifts_fast_is_no_wrong_angle(record: Record) -> None:
    loaded = small_scan("paper_1995")
    simulation = loaded.rig.simulation.model_copy(update={"lamp_drift_per_hour": -0.1})
    scan(changed(loaded, rig={"simulation": simulation}), record)


def _read_again(name: str) -> Loaded:
    """A small scan whose tile is read once more at the end of each setting of the lamp by hand."""
    loaded = small_scan(name)
    own = loaded.protocol.references
    assert own.white_tile is not None
    tile = own.white_tile.model_copy(update={"again_at_end": True})
    return changed(loaded, references=References(white_tile=tile, drift_check=own.drift_check))


@pytest.mark.parametrize("rig_name", RIGS)
@pytest.mark.parametrize("seed", range(20))
def test_the_tile_at_the_end_may_differ_by_what_uncertainties_explain(
    rig_name: str, seed: int
) -> None:
    """Noise and placement at random; a change of 2 % or more that nothing explains is told."""
    random, rig = np.random.default_rng(seed), rig_of(rig_name)
    theta_i, constant = float(random.uniform(0, 70)), Drift((), np.nan)
    before, after = (tile(rig_name, theta_i, 1.0) for _ in range(2))
    u = Placement(rig.u_placement_mm, theta_i, rig.lamp_distance_mm).u_irradiance
    before, after = (
        replace(r, u_placement_dn=u * r.signal_dn,
                signal_dn=r.signal_dn * (1 + u * random.standard_normal()))
        for r in (before, after)
    )  # fmt: skip
    after = replace(after, time_s=float(random.uniform(5, 600)))
    assert not repeat_doubt(after, before, constant, rig)
    changed_by = float(random.choice([-1, 1])) * (0.05 + 15 * u)
    found = repeat_doubt(
        replace(after, signal_dn=before.signal_dn * (1 + changed_by)), before, constant, rig
    )
    assert "times the light that it gave before" in found


@pytest.mark.parametrize("rig_name", RIGS)
def test_a_sound_scan_has_the_same_values_with_the_tile_at_the_end(
    rig_name: str, undisturbed: Undisturbed
) -> None:
    found = undisturbed(rig_name, read_again=True)
    assert not any(found.flags)
    assert found.brdf == pytest.approx(undisturbed(rig_name).brdf, rel=0.01)


@pytest.mark.parametrize("rig_name", RIGS)
@pytest.mark.parametrize("level", [0.97, 0.02])
def test_a_lamp_that_changes_after_the_tile_is_told_by_the_tile_at_the_end(
    rig_name: str,
    level: float,
    record: Record,
    undisturbed: Undisturbed,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The drift checks all come after the change: they agree with one another."""
    loaded, good = _read_again(rig_name), undisturbed(rig_name, read_again=True)
    first = next(step.index for step in make_plan(loaded).steps if step.kind == "drift")
    fault = LampFault(at_step={first: level}).install(monkeypatch)
    with pytest.raises(Interlock, match=r"white tile: white tile at|light: white tile at"):
        scan(loaded, record)
    assert all(reduce(record.readings(), loaded.protocol, record.checks()).flags)
    fault.at_step = None
    scan(loaded, record)
    found = reduce(record.readings(), loaded.protocol, record.checks())
    assert not any(found.flags)
    assert found.brdf == pytest.approx(good.brdf, rel=5e-3)
