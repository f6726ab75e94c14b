"""The stated uncertainty holds on a bench with the defects of a real one, all drawn anew."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from analysis.data.acceptance import Acceptance
from analysis.fit.fit import fit
from analysis.models import MODELS
from instrument.config.load import Loaded
from instrument.errors import Interlock
from tests.support.scans import changed
from tests.support.whole_scans.coverage_scans import Deviations, by_band, by_parameter
from tests.support.whole_scans.real_bench import (
    SAMPLES,
    measured,
    plaster_run,
    pulls_of,
    real_bench_run,
)

_RUNS = 600 * len(SAMPLES)
_FEW = 2  # in a normal run
# Of the runs, whose drawn lamp may drift so fast that the drift check stops the scan.
_MOST_STOPPED = 0.02
_COVERED = 1.96
_MOST = {"albedo": 0.005, "sigma_deg": 0.3}  # rms error of sample A that is asked for
_BENCHES, _VIEWS = 60, 31  # views as in the shipped protocol
_FEW_VIEWS = 7
_FAR = 4.0  # times that limit: no single run misses it by chance


def _pulls(folder: Path, runs: int, lines: dict[str, float] | None = None) -> list[Deviations]:
    """Deviations of the runs that are not stopped; of many, in as many processes as cores."""
    one = partial(_pull, folder=folder, runs=runs, lines=lines)
    if runs == _FEW:
        found = [one(number) for number in range(runs)]
    else:
        with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
            found = list(pool.map(one, range(runs)))
    complete = [pulls for pulls in found if pulls is not None]
    assert len(complete) >= (1 - _MOST_STOPPED) * runs
    return complete


def _pull(
    number: int, folder: Path, runs: int, lines: dict[str, float] | None
) -> Deviations | None:
    try:
        return pulls_of(real_bench_run(number, folder, runs, lines=lines), folder / str(number))
    except Interlock as stopped:
        if "let it warm up" not in str(stopped):
            raise
        return None


@pytest.mark.slow
def test_deviations_on_a_real_bench_have_the_size_of_their_u(
    slow: bool, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """Mean, standard deviation and coverage of (value - truth) / u, by band and by parameter.

    `--slow`: 600 runs of each sample, as 150 tell a parameter's mean to 0.08 u only, within the
    limits that are asked of them, at the precision of these: 600 runs tell a coverage to 0.7 %.
    `--junitxml` shows the figures. The points of a run share most errors. Otherwise a few runs, in
    which nothing is far off.
    """
    found = _pulls(tmp_path, _RUNS if slow else _FEW)
    wrong: list[tuple[str, float, float, float]] = []
    for name, own in {**by_band(found), **by_parameter(found)}.items():
        mean, sd = float(np.mean(own)), float(np.std(own))
        covered = float(np.mean(np.abs(own) < _COVERED))
        record_property(name, f"mean {mean:+.2f} u, sd {sd:.2f} u, within 1.96 u {covered:.1%}")
        asked = abs(round(mean, 2)) <= 0.15, 0.88 <= round(sd, 2) <= 1.12
        if slow and not (all(asked) and 0.93 <= round(covered, 2) <= 0.97):
            wrong.append((name, round(mean, 2), round(sd, 2), round(covered, 3)))
        if np.max(np.abs(own)) > 6:
            wrong.append((name, mean, sd, float(np.max(np.abs(own)))))
    assert not wrong


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["stray_light", "tile_aged"])
def test_a_correction_that_is_left_out_shows(effect: str, slow: bool, tmp_path: Path) -> None:
    """At grazing view the mean deviation is then beyond its limit."""
    if not slow:
        pytest.skip("with --slow")
    found = _pulls(tmp_path, 200, {effect: 0.0, f"u_{effect}": 0.0})
    assert abs(float(np.mean(by_band(found)["75 to 85 deg"]))) > 0.15


def _out_of_plane(loaded: Loaded) -> Loaded:
    (sweep,) = loaded.protocol.sweeps
    return changed(loaded, sweeps=[{**sweep, "dphi_deg": [45.0]}])


def _with_8_bits(loaded: Loaded) -> Loaded:
    camera = loaded.rig.camera.model_copy(update={"bit_depth": 8, "black_level_dn": 8.0})
    return changed(loaded, rig={"camera": camera})


def _without_tile(loaded: Loaded) -> Loaded:
    """With a warm lamp: a scan that need not read a tile begins while another would warm up."""
    simulation, references = loaded.rig.simulation, loaded.protocol.references
    lamp = simulation.lamp_defects.model_copy(update={"warm_up": 0.0})
    warm = simulation.model_copy(update={"lamp_defects": lamp})
    return changed(
        loaded,
        rig={"simulation": warm},
        references=references.model_copy(update={"white_tile": None}),
    )


_OTHER_SCANS = {
    "out of plane": _out_of_plane,
    "camera with 8 bits": _with_8_bits,
    "no white tile": _without_tile,
}


@pytest.mark.slow
@pytest.mark.parametrize("other", _OTHER_SCANS)
def test_deviations_of_other_scans_have_the_size_of_their_u(
    other: str, slow: bool, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """`--slow`: 120 runs, the limits four standard errors wide; else one, not far off.

    Without a tile only the parameters of the shape are compared.
    """
    change, runs = _OTHER_SCANS[other], 120 if slow else 1
    loaded = (change(real_bench_run(number, tmp_path, runs)) for number in range(runs))
    found = [pulls_of(one, tmp_path / str(number)) for number, one in enumerate(loaded)]
    bands = {} if other == "no white tile" else by_band(found)
    for name, own in {**bands, **by_parameter(found)}.items():
        mean, sd = float(np.mean(own)), float(np.std(own))
        covered = float(np.mean(np.abs(own) < _COVERED))
        record_property(name, f"mean {mean:+.2f} u, sd {sd:.2f} u, within 1.96 u {covered:.1%}")
        assert np.max(np.abs(own)) < 6, name
        if slow:
            independent = min(own.size, runs)
            assert abs(mean) < 0.15 + 4 / np.sqrt(independent), name
            assert abs(sd - 1) < 0.12 + 4 / np.sqrt(2 * independent), name


def _plaster_error(number: int, folder: Path, views: int) -> dict[str, float]:
    """Scan on bench `number` with 4 frames a point, fit, and return the parameters' errors."""
    loaded = plaster_run(number, folder, _BENCHES, views)
    sample = loaded.protocol.simulated_sample
    assert sample is not None
    assert loaded.protocol.frames_per_point == 4
    acceptance = Acceptance.of(loaded.rig, loaded.protocol.window)
    fitted = fit(MODELS[sample.model], measured(loaded, folder / str(number)), acceptance)
    return {name: fitted.values[name] - sample.parameters[name] for name in _MOST}


@pytest.mark.slow
def test_albedo_and_roughness_of_plaster_are_as_accurate_as_asked(
    slow: bool, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """`--slow`: rms over 60 benches with drawn defects; else one with few views, not far off."""
    runs, views = (_BENCHES, _VIEWS) if slow else (1, _FEW_VIEWS)
    errors = [_plaster_error(number, tmp_path, views) for number in range(runs)]
    for name, most in _MOST.items():
        own = np.array([one[name] for one in errors])
        rms = float(np.sqrt(np.mean(np.square(own))))
        record_property(name, f"rms error {rms:.4f}, mean {np.mean(own):+.4f}, {len(own)} runs")
        assert rms <= (most if slow else _FAR * most), name
