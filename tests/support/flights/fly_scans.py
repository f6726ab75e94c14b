"""Small scans with `motion: fly` of a simulated bench, and what their frames should show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition.measure.window import window_at
from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import FlyConfig, References, Steps
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole
from sim.scene.render import electrons_per_s
from tests.support.paths import CONFIGS
from tests.support.scans import changed, exact_rig, shrunk, simulated_scene


def fly_scan(num: int = 17, shrink: int = 8) -> Loaded:
    """The demonstration at two incidences with few pixels and a matt sample, flown."""
    demo = shrunk(load_protocol(CONFIGS / "protocols" / "demo.yaml"), shrink)
    sweep = {
        "theta_i_deg": [30.0, 60.0],
        "dphi_deg": [0.0],
        "theta_r_deg": Steps(start=-70.0, stop=70.0, num=num),
    }
    sample = demo.protocol.simulated_sample
    assert sample is not None
    matt = {"model": "lambert", "parameters": {"albedo": 0.8}}
    return changed(
        demo,
        sweeps=[sweep],
        motion="fly",
        frames_per_point=1,
        simulated_sample=sample.model_copy(update=matt),
    )


def with_latency(loaded: Loaded, latency_s: float) -> Loaded:
    """Copy whose theta_r reports positions that are older by `latency_s` than its frames."""
    simulation = loaded.rig.simulation
    axes = simulation.axis_defects
    beam = axes.theta_r.model_copy(update={"latency_s": latency_s})
    defects = {"axis_defects": axes.model_copy(update={"theta_r": beam})}
    return changed(loaded, rig={"simulation": simulation.model_copy(update=defects)})


def narrow_lobe_scan(random: np.random.Generator) -> Loaded:
    """Random lobe, about 2 degrees wide at half height, of a random peak, direction and latency.

    Its bench has exact angles and a constant lamp, so that only flying makes errors.
    """
    demo = shrunk(load_protocol(CONFIGS / "protocols" / "demo.yaml"), 4)
    exact = replace(demo, rig=exact_rig(demo.rig))
    seed = {"seed": int(random.integers(2**30))}
    exact = changed(exact, rig={"simulation": exact.rig.simulation.model_copy(update=seed)})
    theta_i = float(random.uniform(30.0, 60.0))
    middle = -theta_i + float(random.uniform(-1.0, 1.0))
    side = 8.0 * float(random.choice([-1.0, 1.0]))
    num = int(random.integers(21, 41))
    sweep = {
        "theta_i_deg": [theta_i],
        "dphi_deg": [0.0],
        "theta_r_deg": Steps(start=middle - side, stop=middle + side, num=num),
    }
    sample = demo.protocol.simulated_sample
    assert sample is not None
    spike = float(random.uniform(2e-4, 1e-3))
    lobe = {
        "model": "unified",
        "parameters": {
            "diffuse": 0.4,
            "lobe": 0.02,
            "sigma_deg": 20.0,
            "spike": spike,
            "spike_width_deg": 2.0 / np.sqrt(8 * np.log(2)),
        },
        "mottling": 0.0,
    }
    flown = changed(
        exact,
        sweeps=[sweep],
        motion="fly",
        frames_per_point=1,
        fly=FlyConfig(narrowest_lobe_deg=2.0),
        references=References(),
        simulated_sample=sample.model_copy(update=lobe),
    )
    return with_latency(flown, float(random.uniform(-0.03, 0.03)))


def rates_at_rest(loaded: Loaded, theta_i_deg: float, theta_r_deg: FloatArray) -> FloatArray:
    """Counts per second of the window at rest at view angles (N,), without noise or lamp drift."""
    scene, patch = simulated_scene(loaded, theta_i_deg), loaded.protocol.window
    pinhole, rates = Pinhole.of(loaded.rig), []
    for angle_deg in theta_r_deg.tolist():
        scene.true_deg["theta_r"] = angle_deg
        window = window_at(angle_deg, pinhole, patch.width_mm, patch.height_mm)
        rates.append(window.mean(electrons_per_s(scene)[window.crop].astype(np.float64)))
    return np.array(rates) / loaded.rig.camera.electrons_per_dn
