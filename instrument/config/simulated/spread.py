"""Spread of a defect's size, when a bench is drawn from its seed: see `sim.defects.drawn_bench`.

Keys of a rig file's `simulation:` section carry it in their types.
"""

from __future__ import annotations

from enum import Enum
from typing import Annotated

from pydantic import Field


class Spread(Enum):
    """Kinds of spread about the size `s` that the file gives.

    SIGNED: normal, of mean 0 and standard deviation `s`, redrawn beyond 2 `s`: errors of either
    sign. SIZE: uniform from 0.5 `s` to 1.5 `s`: defects of one sign.
    """

    SIGNED = "signed"
    SIZE = "size"


Signed = Annotated[float, Field(allow_inf_nan=False), Spread.SIGNED]
Size = Annotated[float, Field(ge=0, allow_inf_nan=False), Spread.SIZE]
Share = Annotated[float, Field(ge=0, le=0.5), Spread.SIZE]
