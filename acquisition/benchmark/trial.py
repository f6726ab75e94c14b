"""One method at work: what it costs, and how far it is off an independent truth."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Trial:
    """A method in a scene.

    study, scene, series, label: where it belongs in the charts; labels are unique in a scene.
    cost, error: in the units of the study's axes, both better when lower; `error` is the worst one
    (or the root mean square where the study says so), `error_median` the typical one. An infinite
    error: it gave no value.
    default: the program's own choice. peer: another program's method. bound: no method, but what
    physics leaves possible. failures: of `attempts`, how many did not arrive.
    note: what a reader should know; `more`: further figures by name, with the unit in the name.
    Raises `ValueError` for a cost that is not positive and finite, or a negative error.
    """

    study: str
    scene: str
    series: str
    label: str
    cost: float
    error: float
    error_median: float
    default: bool = False
    peer: bool = False
    bound: bool = False
    failures: int = 0
    attempts: int = 0
    note: str = ""
    more: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.cost) and self.cost > 0):
            raise ValueError(f"{self._name}: cost = {self.cost:g}; allowed: finite, more than 0")
        for name in ("error", "error_median"):
            value = getattr(self, name)
            if not value >= 0:  # also false for NaN
                raise ValueError(f"{self._name}: {name} = {value:g}; allowed: 0 or more")
        if not 0 <= self.failures <= self.attempts:
            raise ValueError(
                f"{self._name}: failures = {self.failures}; allowed: 0 to {self.attempts} attempts"
            )

    @property
    def _name(self) -> str:
        return f"{self.study}, {self.scene}, {self.label}"


def pareto_front(trials: Iterable[Trial]) -> list[Trial]:
    """The trials that none other beats in cost and error at once, by rising cost.

    Of equal ones the first is kept; bounds are no methods, and an infinite error is no result.
    """
    front: list[Trial] = []
    usable = (t for t in trials if not t.bound and math.isfinite(t.error))
    for trial in sorted(usable, key=lambda t: (t.cost, t.error)):
        if not front or trial.error < front[-1].error:
            front.append(trial)
    return front
