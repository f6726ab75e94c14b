"""Data frames of pandas, which is used where it is installed and needed by nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

from instrument.geometry import FloatArray


def data_frame(columns: Mapping[str, FloatArray | Sequence[str]]) -> Any:
    """Return a DataFrame of columns (N,) each, whose names state their units.

    Raises `ImportError` if pandas is not installed.
    """
    try:
        pandas = import_module("pandas")
    except ImportError:
        raise ImportError("pandas is not installed: pip install pandas, then try again") from None
    return pandas.DataFrame(dict(columns))
