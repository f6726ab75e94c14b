"""Model for which the next points are chosen: it does not change by chance."""

from __future__ import annotations

import pytest

from acquisition.adaptive.aims import Aims
from acquisition.adaptive.chooser import Chooser
from acquisition.adaptive.knowledge import Knowledge, usual_model
from acquisition.adaptive.layout import Layout
from acquisition.plan.plan import make_plan
from instrument.record.reading import Batch
from tests.support.adaptive.predicted_bench import PredictedBench, adaptive_scan

MODELS = "lambert, oren_nayar"
MATT = ("lambert", {"albedo": 0.8})
ROUGH = ("oren_nayar", {"albedo": 0.8, "sigma_deg": 30.0})


def known(sample: tuple[str, dict[str, float]], former: str) -> Knowledge:
    loaded = adaptive_scan("albedo=0.01", models=MODELS)
    aims, layout = Aims.of(loaded), Layout(make_plan(loaded), loaded)
    bench = PredictedBench(loaded, 5, sample, Chooser(layout, aims))
    return Knowledge.of(bench.all_readings(), (), loaded, aims, former)


@pytest.mark.parametrize(
    ("sample", "former", "leading", "contested"),
    [
        (MATT, "", "lambert", False),
        (MATT, "lambert", "lambert", False),
        (MATT, "oren_nayar", "oren_nayar", True),  # it fits as well, with a parameter more
        (ROUGH, "lambert", "oren_nayar", False),  # very strong evidence is against it
    ],
)
def test_the_former_leader_stays_until_there_is_very_strong_evidence(
    sample: tuple[str, dict[str, float]], former: str, leading: str, contested: bool
) -> None:
    found = known(sample, former)
    assert found.model == sample[0]
    assert found.leading is not None
    assert (found.leading.model, found.contested) == (leading, contested)


def test_the_usual_model_is_that_of_most_batches() -> None:
    def batches(*models: str) -> list[Batch]:
        return [
            Batch(number=n, steps=(), frames=(), reasons=(), model=model)
            for n, model in enumerate(models)
        ]

    assert usual_model(batches()) == ""
    assert usual_model(batches("", "", "lambert")) == "lambert"
    # The same physics by another method: two of each, the later one leads.
    even = batches("", "lambert", "oren_nayar", "lambert", "oren_nayar_exact")
    assert usual_model(even) == "oren_nayar_exact"
    assert usual_model(batches("oren_nayar", "lambert", "lambert")) == "lambert"
