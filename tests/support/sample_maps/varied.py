"""Scans of simulated samples that vary, with kept frames, and the truth of each cell."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.results.maps.sample_map import map_sample
from analysis.sample_maps.sample_map import SampleMap
from instrument.config.load import Loaded
from instrument.config.protocol import References, Steps
from instrument.config.simulated.sample import SimulatedSample, Variation
from instrument.devices import CHANNELS
from instrument.geometry import FloatArray
from instrument.record.record import Record
from sim.scene.variation import share_at
from tests.support.scans import changed, small_scan
from tests.support.whole_scans.stopped_scan import scan

CELL_MM = 2.0
RESPONSES = [0.7, 1.0, 0.8]
"""Of the channels of a colour camera; white is no longer grey."""


@dataclass(frozen=True, slots=True)
class Varied:
    """Pattern of a sample's variation, and how it is scanned.

    colour: by a camera of three channels with responses of their own, each of which sees other
    albedos; green sees those that a camera of one channel would see.
    """

    pattern: str
    incidences: tuple[float, ...]
    tile: bool
    seed: int
    colour: bool = False

    def loaded(self, shrink: int = 4) -> Loaded:
        """Return a scan with 1/shrink of the camera's pixels, of parameters drawn from the seed."""
        small, random = small_scan(shrink=shrink), np.random.default_rng(self.seed)
        one, other = (
            {"albedo": float(a), "sigma_deg": float(s)}
            for a, s in zip(random.uniform(0.3, 0.9, 2), random.uniform(12, 40, 2), strict=True)
        )
        variation = Variation.model_validate(
            {"pattern": self.pattern, "parameters": other, "size_mm": 20.0}
        )
        simulation = small.rig.simulation.model_copy(update={"seed": self.seed})
        sample = SimulatedSample(model="oren_nayar", parameters=one, variation=variation)
        camera = small.rig.camera
        if self.colour:
            camera = camera.model_copy(update={"channels": 3})
            simulation = simulation.model_copy(update={"channel_responses": RESPONSES})
            sample = _in_colour(sample, random)
        references = small.protocol.references
        if not self.tile:
            references = References(drift_check=references.drift_check)
        views = Steps(start=-72.0, stop=72.0, num=11)
        return changed(
            small,
            rig={"simulation": simulation, "camera": camera},
            sweeps=[
                {
                    "theta_i_deg": list(self.incidences),
                    "dphi_deg": [0.0],
                    "theta_r_deg": views,
                }
            ],
            references=references,
            keep_frames=True,
            frames_per_point=1,
            simulated_sample=sample,
        )

    def mapped(self, run: Path, cell_mm: float = CELL_MM) -> tuple[SampleMap, Loaded]:
        """Scan into the folder `run`, and map the sample."""
        loaded = self.loaded()
        with Record.create(run, {}) as record:
            scan(loaded, record)
            return map_sample(record, loaded, "oren_nayar", cell_mm), loaded


def _in_colour(sample: SimulatedSample, random: np.random.Generator) -> SimulatedSample:
    """Return the sample with albedos in red and blue that are drawn, in both of its places."""
    other = sample.variation
    assert other is not None
    one, two = (
        [float(random.uniform(0.15, 0.9)), albedo, float(random.uniform(0.15, 0.9))]
        for albedo in (sample.parameters["albedo"], other.parameters["albedo"])
    )
    variation = other.model_copy(update={"channel_albedos": two})
    return sample.model_copy(update={"channel_albedos": one, "variation": variation})


def truth(found: SampleMap, loaded: Loaded) -> dict[str, FloatArray]:
    """Return the true parameters (rows, columns); NaN in cells that an edge of the pattern cuts."""
    sample = loaded.protocol.simulated_sample
    assert sample is not None
    assert sample.variation is not None
    corner = 0.5 * found.cell_mm + 0.5  # pixels of half a millimetre blur an edge
    shares = []
    for x in (-corner, 0.0, corner):
        for y in (-corner, 0.0, corner):
            points = np.stack(np.meshgrid(found.x_mm + x, found.y_mm + y), axis=-1)
            shares.append(share_at(points, sample.variation, loaded.protocol.sample))
    share = shares[4]
    if sample.variation.pattern != "gradient":
        share = np.where(np.ptp(shares, axis=0) > 0, np.nan, share)
    true: dict[str, FloatArray] = {}
    for n, channel in enumerate(CHANNELS):
        own = sample.in_channel(n)
        assert own.variation is not None
        ends = {**own.parameters, **own.variation.parameters}
        values = {k: (1 - share) * v + share * ends[k] for k, v in own.parameters.items()}
        if found.colour is None:
            return values
        true["sigma_deg"], true[f"albedo_{channel}"] = values["sigma_deg"], values["albedo"]
    return true
