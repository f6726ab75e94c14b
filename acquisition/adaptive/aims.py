"""Aims of an adaptive scan: u wanted of parameters, and the models that may have them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from acquisition.adaptive.candidate_list import goal_of_protocol, where
from acquisition.design.forecast import UNDETERMINED
from analysis.choice.ladder import CANDIDATES, MethodOfFit, with_method
from analysis.fit.relative_scale import unscaled_parameters
from analysis.models import MODELS, Parameter
from instrument.config.load import Loaded
from instrument.errors import InputError
from instrument.text.quoting import printable

MARGIN = 0.99
"""Share of the wanted u that is aimed at: a last reading of the white tile may change it a bit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Aims:
    """u wanted of each parameter, in its unit; `budget_s`: bench time, None without a limit.

    models: candidates of the quick fits, None for the ladder with `method`.
    """

    u: Mapping[str, float]
    budget_s: float | None
    models: tuple[str, ...] | None
    method: MethodOfFit

    @classmethod
    def of(cls, loaded: Loaded) -> Aims:
        """Return the aims of a protocol with a goal; raise `InputError` where it cannot be one."""
        fit, budget_min = loaded.protocol.fit, loaded.protocol.budget_min
        names = None if fit.models is None else tuple(fit.models)
        # The exact integral costs seconds a fit, and its functional form chooses as well.
        method: MethodOfFit = "functional" if names is None and fit.method == "auto" else fit.method
        aims = cls(
            u=goal_of_protocol(loaded),
            budget_s=None if budget_min is None else 60 * budget_min,
            models=names,
            method=method,
        )
        problems = list(aims._mistakes(loaded))
        if problems:
            raise InputError(*problems)
        return aims

    @property
    def text(self) -> str:
        """The goal as it is written in an option."""
        return ",".join(f"{name}={u:g}" for name, u in self.u.items())

    def reached(self, u: Mapping[str, float | None], margin: float = 1.0) -> bool:
        """Return True if every u is as small as wanted."""
        return not self.missed(u, margin)

    def missed(self, u: Mapping[str, float | None], margin: float = 1.0) -> list[str]:
        """Return the parameters whose u is not known, or larger than wanted."""
        found = {name: u.get(name) for name in self.u}
        return [n for n, own in found.items() if own is None or own > margin * self.u[n]]

    def _mistakes(self, loaded: Loaded) -> Iterator[str]:
        """Yield what is wrong with a goal: an unknown parameter, a u that says nothing."""
        known = self._parameters(absolute=loaded.protocol.references.white_tile is not None)
        for name, u in self.u.items():
            at = where(loaded, printable(name))
            if name not in known:
                allowed = ", ".join(known) or "none, without a white tile"
                yield f"{at}: no parameter that this scan can determine; allowed: {allowed}"
                continue
            most = UNDETERMINED * (known[name].high - known[name].low)
            if not 0 < u <= most:
                allowed = f"more than 0, up to {most:g}, a quarter of its domain"
                yield f"{at}: u {u:g}; allowed: {allowed}"

    def _parameters(self, *, absolute: bool) -> dict[str, Parameter]:
        """Parameters of the candidates by name, of the widest domain; those without a scale."""
        found: dict[str, Parameter] = {}
        for name in self.models or with_method(CANDIDATES, self.method):
            model = MODELS[name]
            lost = frozenset[str]() if absolute else unscaled_parameters(model)
            for p in (p for p in model.parameters if p.name not in lost):
                if p.name not in found or p.high - p.low > found[p.name].high - found[p.name].low:
                    found[p.name] = p
        return found
