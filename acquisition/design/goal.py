"""Goal of a scan: the standard uncertainty that each of some parameters is wanted with."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from acquisition.design.assumed_sample import AssumedSample
from acquisition.design.forecast import UNDETERMINED, asked_parameters
from analysis.models import Parameter
from instrument.config.load import Loaded
from instrument.errors import InputError
from instrument.text.quoting import printable

_FORM = "NAME=U[,NAME=U], as in sigma_deg=0.2,albedo=0.005"


@dataclass(frozen=True, slots=True)
class Goal:
    """Wanted u of each parameter asked for, in its unit."""

    u: Mapping[str, float]

    @property
    def text(self) -> str:
        """The goal as it is written in an option."""
        return ",".join(f"{name}={u:g}" for name, u in self.u.items())

    def missed(self, u: Mapping[str, float]) -> list[str]:
        """Return the parameters of which a scan's u (by name) is larger than wanted."""
        return [name for name, wanted in self.u.items() if not u[name] <= wanted]


def goal_of(text: str, sample: AssumedSample, loaded: Loaded) -> Goal:
    """Return the goal that `--until` names, for a sample.

    Raises `InputError` for a text of another form, a u that is not positive or says nothing, and a
    parameter that the model does not have or the scan does not determine.
    """
    wanted = wanted_u(text)
    names = asked_parameters(",".join(wanted), sample, loaded, "--until")
    parameters = {p.name: p for p in sample.model.parameters}
    for name in names:
        _require_useful(wanted[name], parameters[name])
    return Goal(wanted)


def wanted_u(text: str) -> dict[str, float]:
    """Return the u that `--until` names, by parameter; raise `InputError` for another form."""
    wanted: dict[str, float] = {}
    for part in text.split(","):
        name, _, number = (word.strip() for word in part.partition("="))
        try:
            u = float(number)
        except ValueError:
            name = ""
        if not name:
            raise InputError(f"--until: {printable(part) or 'nothing'}; allowed: {_FORM}")
        if name in wanted:
            raise InputError(f"--until: {printable(name)} is named twice; allowed: once")
        wanted[name] = u
    return wanted


def _require_useful(u: float, parameter: Parameter) -> None:
    most = UNDETERMINED * (parameter.high - parameter.low)
    if not (math.isfinite(u) and 0 < u <= most):
        raise InputError(
            f"--until {parameter.name}={u:g}; allowed: a standard uncertainty of more than 0, up "
            f"to {most:g}, a quarter of its domain"
        )
