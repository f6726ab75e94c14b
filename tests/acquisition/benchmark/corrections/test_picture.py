"""Chart of the corrections: all are in it, in the order of their worth, with their figures."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

from acquisition.benchmark.corrections.picture import picture_of
from acquisition.benchmark.corrections.worth import ALL, BANDS_DEG, WITH, WITHOUT, Worth, worth
from instrument.geometry import FloatArray


def of_error(size: float) -> Worth:
    """Errors of either sign, of one size, with a mean of half of it."""
    theta_r: FloatArray = np.repeat([-30.0, 30.0, 68.0, -80.0], 4)
    return Worth(theta_r, size * np.tile([1.0, 1.0, 1.0, -1.0], 4))


def test_the_chart_names_every_correction_with_its_error() -> None:
    sizes = {"all corrections": 0.002, **{n: 0.003 + 0.001 * k for k, n in enumerate(WITHOUT)}}
    sizes |= dict.fromkeys(WITH, 0.001)
    picture = picture_of({name: of_error(size) for name, size in sizes.items()}, 3)
    ElementTree.fromstring(picture.svg)
    rows = list(zip(*picture.columns.values(), strict=True))
    assert len(rows) == len(BANDS_DEG) * len(sizes)
    by_name = {str(row[0]): row for row in rows}
    assert by_name["all corrections"][3:] == pytest.approx((0.2, 0.1, 0.0))
    assert by_name["without drift checks"][3] == pytest.approx(100 * sizes["drift checks"])
    assert by_name["with dark patch for stray light"][3:] == pytest.approx((0.1, 0.05, 0.1))
    assert "3 benches" in picture.caption


def test_the_tile_s_table_is_worth_more_than_all_that_is_left() -> None:
    """By 5 % of the radiance factor at some incidence, against errors of some tenths."""
    one_number, table = worth(WITHOUT["table of the white tile"], 1), worth(ALL, 1)
    for band in BANDS_DEG:
        assert one_number.rms(band) > 3 * table.rms(band)
