"""Method under test: a callable, with the name and the mark of its trials in the charts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Generic, TypedDict, TypeVar

import numpy as np

from acquisition.benchmark.timing import Timed
from acquisition.benchmark.trial import Trial
from instrument.geometry import FloatArray

Call_co = TypeVar("Call_co", bound=Callable[..., object], covariant=True)


@dataclass(frozen=True, slots=True)
class Method(Generic[Call_co]):
    """A callable to compare; series, label, default, peer and note are those of its trials.

    before: runs before each timed call. own_starts: a fit that needs no start.
    """

    series: str
    label: str
    call: Call_co
    _: KW_ONLY
    default: bool = False
    peer: bool = False
    note: str = ""
    before: Callable[[], object] | None = None
    own_starts: bool = False

    def trial(
        self,
        study: str,
        scene: str,
        *,
        cost: float,
        error: float,
        error_median: float,
        failures: int = 0,
        attempts: int = 0,
        more: Mapping[str, float] | None = None,
    ) -> Trial:
        """Return a trial of this method."""
        return Trial(
            study=study, scene=scene, series=self.series, label=self.label, cost=cost, error=error,
            error_median=error_median, default=self.default, peer=self.peer, failures=failures,
            attempts=attempts, note=self.note, more=more or {},
        )  # fmt: skip

    def timed_trial(
        self, study: str, scene: str, time: Timed[FloatArray], per_s: float, errors: FloatArray
    ) -> Trial:
        """Return a trial from a timed call that gave one value per geometry or view.

        Cost per value in units of which `per_s` are a second; `errors` is (N,), relative.
        """
        size = np.abs(errors)
        return self.trial(
            study, scene, cost=per_s * time.least_s / time.value.size, error=float(np.max(size)),
            error_median=float(np.median(size)), more={"spread_of_cost": time.spread},
        )  # fmt: skip


class Errors(TypedDict):
    """Error and median error of a trial, as its keywords."""

    error: float
    error_median: float


def rms_and_median(errors: FloatArray) -> Errors:
    """Return the root mean square and the median size of (N,) relative errors."""
    return {
        "error": float(np.sqrt(np.mean(errors**2))),
        "error_median": float(np.median(np.abs(errors))),
    }
