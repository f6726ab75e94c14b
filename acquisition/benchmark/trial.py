"""Trial: one method in one scene, with its cost and its error against an independent truth."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """Cost and error of a method in a scene.

    study, scene, series, label: place in the charts; labels are unique within a scene.
    cost, error: in the units of the study's axes, both better when lower; `error` is the largest
    (or the root mean square where the study says so), `error_median` the typical one. An infinite
    error means that the method gave no value.
    default: the program's own choice. peer: method of another program. bound: no method, but a
    limit set by physics. failures: number of the `attempts` that did not converge.
    note: remark for the reader; `more`: further figures by name, with the unit in the name.
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
        name = f"{self.study}, {self.scene}, {self.label}"
        if not (math.isfinite(self.cost) and self.cost > 0):
            raise ValueError(f"{name}: cost = {self.cost:g}; allowed: finite, more than 0")
        for key in ("error", "error_median"):
            value = getattr(self, key)
            if not value >= 0:  # also false for NaN
                raise ValueError(f"{name}: {key} = {value:g}; allowed: 0 or more")
        if not 0 <= self.failures <= self.attempts:
            raise ValueError(
                f"{name}: failures = {self.failures}; allowed: 0 to {self.attempts} attempts"
            )


def select(
    trials: Iterable[Trial],
    *,
    scene: str | None = None,
    label: str | None = None,
    default: bool | None = None,
) -> list[Trial]:
    """Return the trials of a scene, a label, and the default or the other methods; None: any."""
    wanted = {"scene": scene, "label": label, "default": default}
    wanted = {name: value for name, value in wanted.items() if value is not None}
    return [t for t in trials if all(getattr(t, n) == value for n, value in wanted.items())]


def pareto_front(trials: Iterable[Trial]) -> list[Trial]:
    """Return the trials that no other beats in both cost and error, by rising cost.

    Of equal trials the first is kept. Bounds are no methods and an infinite error is no result:
    neither is on the front.
    """
    front: list[Trial] = []
    usable = (t for t in trials if not t.bound and math.isfinite(t.error))
    for trial in sorted(usable, key=lambda t: (t.cost, t.error)):
        if not front or trial.error < front[-1].error:
            front.append(trial)
    return front
