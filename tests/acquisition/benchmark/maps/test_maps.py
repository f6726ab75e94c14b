"""The maps' pictures: whole, readable in grey, and what they say is what the program goes by."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from acquisition.benchmark.maps.map_style import MapPicture, Reason, columns_of, joined
from acquisition.benchmark.maps.maps import draw_maps, lobe_picture, rough_picture, smooth_picture
from acquisition.benchmark.maps.window_map import FEW_PIXELS, window_picture
from analysis.models import MODELS
from instrument.geometry import Geometry


def drawn(slow: bool, tmp_path_factory: pytest.TempPathFactory) -> list[MapPicture]:
    if slow:
        return draw_maps(tmp_path_factory.mktemp("maps"))
    return [rough_picture("oren_nayar"), smooth_picture(), lobe_picture(), window_picture()]


@pytest.mark.slow
def test_every_map_is_a_picture_with_its_numbers(
    slow: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    pictures = drawn(slow, tmp_path_factory)
    assert len({p.title for p in pictures}) == len(pictures)
    for picture in pictures:
        page = ElementTree.fromstring(picture.svg)  # our own text, made above
        words = " ".join("".join(e.itertext()) for e in page.iter() if e.tag.endswith("text"))
        assert "°" in words or "g" in words
        assert "$" not in words  # no markup is left in a label
        assert picture.caption
        sizes = {len(values) for values in picture.columns.values()}
        assert len(sizes) == 1
        assert sizes.pop() > 100
        if "window" not in picture.title:  # its lines have markers and dashes of their own
            # Without colours: every fill and stroke is a grey.
            for colour in set(re.findall(r"#([0-9a-fA-F]{6})", picture.svg)):
                assert colour[:2].lower() == colour[2:4].lower() == colour[4:].lower()


def test_the_reasons_stand_in_the_picture() -> None:
    svg = rough_picture("oren_nayar_qualitative").svg
    assert "leaves" in svg
    assert "interreflection" in svg


def test_the_numbers_of_a_map_are_the_errors() -> None:
    columns = rough_picture("oren_nayar").columns
    random = np.random.default_rng(1)
    for k in random.integers(0, len(columns["error_percent"]), 12):
        row = {name: float(values[k]) for name, values in columns.items()}
        there = Geometry.from_degrees(
            theta_i=row["theta_i_deg"], theta_r=row["theta_r_deg"], dphi=row["dphi_deg"]
        )
        off = []
        for albedo in (1e-9, 1.0):
            values = {"albedo": albedo, "sigma_deg": row["sigma_deg"]}
            exact = MODELS["oren_nayar_exact"].brdf(there, **values)
            off.append(abs(float(MODELS["oren_nayar"].brdf(there, **values) / exact - 1)))
        # The table in between is good to a percent of the value at the worst.
        assert row["error_percent"] == pytest.approx(100 * max(off), rel=0.02, abs=0.3)


def test_the_window_s_numbers_show_where_it_dies() -> None:
    columns = window_picture().columns
    small = [
        (view, pixels)
        for rig, view, pixels in zip(
            columns["rig"], columns["theta_r_deg"], columns["pixels"], strict=True
        )
        if rig == "paper_1995, 5 mm"
    ]
    dead = [float(view) for view, pixels in small if float(pixels) < FEW_PIXELS]
    # 512 pixels on 90 mm: 5 mm are 809 of them, and 100 are left at acos(100/809) = 83 degrees.
    assert min(dead) == pytest.approx(np.degrees(np.arccos(100 / 809)), abs=0.5)
    assert [view for view, _ in small if float(view) >= min(dead)] == dead


def test_tables_of_maps() -> None:
    table = columns_of(a=np.array(1.0), b=np.array([2.0, 3.0]), c=["x", "y"])
    assert table == {"a": [1.0, 1.0], "b": [2.0, 3.0], "c": ["x", "y"]}
    assert joined([table, table])["c"] == ["x", "y", "x", "y"]
    assert Reason("why", 5.0).from_x == -np.inf
