"""A plan says which parameters a scan without a white tile will not determine."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from acquisition.commands.determinable import Determinable
from acquisition.plan.pose import Pose
from instrument.config.protocol import FitConfig, References
from tests.support.command import gonio_here as gonio
from tests.support.scans import small_demo, small_scan

POINTS = [Pose(30.0, 0.0, view) for view in (0.0, 35.0, 70.0)]

SHAPES = {"sigma_deg", "n", "ks/albedo"}


def test_without_a_tile_no_scale_is_determined_but_shapes_and_ratios_are() -> None:
    protocol = small_scan().protocol
    found = Determinable.of(protocol.model_copy(update={"references": References()}), POINTS)
    assert set(found.no) == {"albedo", "ks"}
    assert set(found.yes) >= SHAPES
    assert set(Determinable.of(protocol, POINTS).yes) >= SHAPES | {"albedo", "ks"}
    assert Determinable.of(protocol, POINTS).no == ()


def test_the_models_are_those_that_the_protocol_names() -> None:
    update = {"references": References(), "fit": FitConfig(models=["unified"])}
    found = Determinable.of(small_scan().protocol.model_copy(update=update), POINTS)
    assert found.no == ("diffuse", "lobe", "spike")
    assert found.yes == ("sigma_deg", "spike_width_deg", "lobe/diffuse", "spike/diffuse")


@pytest.mark.parametrize("tile", [True, False])
def test_a_lamp_scan_with_one_view_determines_nothing_without_a_tile(tile: bool) -> None:
    """The lamp's level at each of its settings is then as free as the sample's brightness."""
    protocol = small_scan().protocol
    if not tile:
        protocol = protocol.model_copy(update={"references": References()})
    found = Determinable.of(protocol, [Pose(lamp, 0.0, 20.0) for lamp in (10.0, 30.0, 50.0)])
    assert bool(found.yes) is tile
    assert set(found.no) >= (set() if tile else SHAPES | {"albedo", "ks"})


@pytest.mark.parametrize("tile", [True, False])
def test_the_plan_says_so_in_words_and_in_json(tile: bool, tmp_path: Path) -> None:
    protocol = small_demo(tmp_path)
    if not tile:
        protocol.write_text(re.sub(r"  white_tile:.*\n", "", protocol.read_text()))
    plan = json.loads(gonio("plan", protocol, "--json").stdout)
    assert ("albedo" in plan["will_not_determine"]) is not tile
    assert ("albedo" in plan["can_determine"]) is tile
    assert set(plan["can_determine"]) >= SHAPES
    text = " ".join(gonio("plan", protocol).stdout.split())
    words = "radiance is relative: the fit will not determine albedo, ks"
    assert (words in text) is not tile
