"""Camera bits: rounding leaves the error that the program states for it."""

from __future__ import annotations

from acquisition.benchmark.demo_scan import shipped_demo
from acquisition.benchmark.studies.camera_bits import DEFAULT, SCENES, bits_study
from tests.support.benchmark import FEW, trial_of


def test_frames_do_not_reduce_the_rounding_error() -> None:
    study = bits_study(FEW)
    bright, dark, _ = study.scenes
    for scene in (bright, dark):
        for frames in (1, 64):
            trial = trial_of(study, scene, f"8 bit × {frames}")
            # 20 draws: within a factor of 2 (chi-square, 20 degrees of freedom: 5 to 45).
            assert 0.5 < trial.error / trial.more["u_rounding_relative"] < 2
    few, many = (trial_of(study, bright, f"12 bit × {n}").error for n in (1, 64))
    assert many < few / 3
    assert trial_of(study, dark, "12 bit × 4").error < trial_of(study, dark, "8 bit × 4").error / 10


def test_the_default_is_the_demonstration() -> None:
    demo = shipped_demo()
    assert (demo.rig.camera.bit_depth, demo.protocol.frames_per_point) == DEFAULT
    assert SCENES[0].level == demo.protocol.exposure_target
    assert SCENES[0].read_noise_electrons == demo.rig.camera.read_noise_electrons
