"""Values of a protocol that contradict one another or its rig are reported with their position."""

from pathlib import Path

import pytest

from instrument.config.load import Loaded, load_protocol
from instrument.errors import InputError
from tests.support.config.mistakes import CHECK_MISTAKES
from tests.support.config.texts import PROTOCOL, RIG, changed, load, problems


@pytest.mark.parametrize("kind", CHECK_MISTAKES)
def test_a_contradiction_in_the_protocol(kind: str) -> None:
    old, new, message = CHECK_MISTAKES[kind]
    assert problems(changed(PROTOCOL, old, new)) == (f"protocol.yaml:{message}",)


def test_a_marker_must_lie_beside_the_sample() -> None:
    """The sample reaches to 25 mm; a marker of 6 mm to 3 mm around its middle."""
    lines = "markers: {{size_mm: 6.0, centres_mm: [[-28.5, 0.0], [{}, 10.0]]}}\n"
    load(protocol=PROTOCOL + lines.format(29.0))
    (covered,) = problems(protocol=PROTOCOL + lines.format(27.0))
    assert "markers.centres_mm[1]: marker 1 at x 27, y 10 mm is covered by the sample" in covered
    assert "beside it, x or y 28 or 28 mm or more from its middle" in covered


def with_polariser(models: str, simulated: str, dphi: str = "0.0") -> str:
    text = changed(PROTOCOL, "models: [lambert, oren_nayar]", f"models: [{models}]")
    text = changed(text, "model: oren_nayar\n", f"model: {simulated}\n")
    return changed(text, "dphi_deg: [0.0]", f"dphi_deg: [{dphi}]") + "polariser_deg: 30\n"


def test_a_polariser_shows_itself_in_the_lobes_of_the_models() -> None:
    loaded = load_any(with_polariser("lambert, lambert+fresnel_lobe", "lambert+fresnel_lobe"))
    assert loaded.protocol.fit.models == ["lambert", "lambert+fresnel_lobe@30"]
    assert loaded.protocol.simulated_sample is not None
    assert loaded.protocol.simulated_sample.model == "lambert+fresnel_lobe@30"


@pytest.mark.parametrize(
    ("models", "simulated", "dphi", "words"),
    [
        ("lambert", "lambert+fresnel_lobe", "0.0", "fit.models: without the model fresnel_lobe"),
        ("fresnel_lobe", "lambert", "0.0", "simulated_sample.model: without the model"),
        ("fresnel_lobe", "fresnel_lobe", "0, 90", "sweeps[0].dphi_deg: 90 deg beside polariser"),
        ("fresnel_lobe, lambert+fresnel_lobe@20", "fresnel_lobe", "0",
         "fit.models: lambert+fresnel_lobe@20 beside polariser_deg; allowed: fresnel_lobe"),
    ],
)  # fmt: skip
def test_a_polariser_that_means_nothing_is_refused(
    models: str, simulated: str, dphi: str, words: str
) -> None:
    with pytest.raises(InputError) as caught:
        load_any(with_polariser(models, simulated, dphi))
    assert len(caught.value.problems) == 1
    assert words in caught.value.problems[0]


def load_any(protocol: str) -> Loaded:
    """Load a protocol whose models are not checked."""
    Path("protocol.yaml").write_text(protocol)
    Path("rig.yaml").write_text(RIG)
    return load_protocol(Path("protocol.yaml"))
