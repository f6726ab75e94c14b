"""Scans of simulated samples that vary, with kept frames, and the truth of each cell."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.results.maps.sample_map import map_sample
from analysis.sample_maps.sample_map import SampleMap
from instrument.config.load import Loaded
from instrument.config.protocol import References, SimulatedSample, Steps, Variation
from instrument.geometry import FloatArray
from instrument.record.record import Record
from sim.scene.variation import share_at
from tests.support.scans import changed, small_scan
from tests.support.whole_scans.stopped_scan import scan

CELL_MM = 2.0


@dataclass(frozen=True, slots=True)
class Varied:
    """Pattern of a sample's variation, and how it is scanned."""

    pattern: str
    incidences: tuple[float, ...]
    tile: bool
    seed: int

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
        references = small.protocol.references
        if not self.tile:
            references = References(drift_check=references.drift_check)
        views = Steps(start=-72.0, stop=72.0, num=11)
        return changed(
            small,
            rig={"simulation": simulation},
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
            simulated_sample=SimulatedSample(
                model="oren_nayar", parameters=one, variation=variation
            ),
        )

    def mapped(self, run: Path, cell_mm: float = CELL_MM) -> tuple[SampleMap, Loaded]:
        """Scan into the folder `run`, and map the sample."""
        loaded = self.loaded()
        with Record.create(run, {}) as record:
            scan(loaded, record)
            return map_sample(record, loaded, "oren_nayar", cell_mm), loaded


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
    other = sample.variation.parameters
    return {k: (1 - share) * v + share * other[k] for k, v in sample.parameters.items()}
