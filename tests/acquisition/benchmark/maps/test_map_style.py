"""Tables and reasons of maps."""

from __future__ import annotations

import numpy as np

from acquisition.benchmark.maps.map_style import Reason, columns_of, joined


def test_tables_of_maps() -> None:
    table = columns_of(a=np.array(1.0), b=np.array([2.0, 3.0]), c=["x", "y"])
    assert table == {"a": [1.0, 1.0], "b": [2.0, 3.0], "c": ["x", "y"]}
    assert joined([table, table])["c"] == ["x", "y", "x", "y"]
    assert Reason("why", 5.0).from_x == -np.inf
