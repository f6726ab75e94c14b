"""Knowledge from the readings so far: a quick fit of the candidates, and the u that it gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from acquisition.adaptive.aims import Aims
from acquisition.adaptive.layout import Layout
from acquisition.plan.plan import Step
from acquisition.results.fitting import fit_run, measurements
from acquisition.results.reduction import reduced_rows
from analysis.choice.choice import Choice, choose
from analysis.choice.ladder import physics
from analysis.fit.fit import FitResult
from instrument.config.load import Loaded
from instrument.errors import GonioError
from instrument.record.reading import Batch, Check, Reading, Rows

_VERY_STRONG = 10.0  # difference of BIC: Kass and Raftery 1995, section 3.2


@dataclass(frozen=True, slots=True)
class Knowledge:
    """Choice of a model so far; `choice` is None where the readings are too few for any fit.

    leading: the candidate that the next points are for, of those with the parameters asked for: the
    chosen one, or the one that was chosen most often before, while the data hardly contradict it.
    contested: another model than that one is chosen now.
    """

    choice: Choice | None = None
    leading: FitResult | None = None
    contested: bool = False

    @classmethod
    def of(
        cls,
        readings: Sequence[Reading],
        checks: Sequence[Check],
        loaded: Loaded,
        aims: Aims,
        former: str = "",
    ) -> Knowledge:
        """Fit the candidates quickly: models are not averaged over lamp and lens.

        former: model that was chosen most often before.
        """
        try:
            m = measurements(reduced_rows(Rows(readings, counted(checks), ()), loaded), loaded)
            choice = choose(m, None, aims.models, method=aims.method)
        except (GonioError, ValueError):
            return cls()  # too few, or all flagged: there is nothing to go by yet
        able = [c for c in choice.candidates if set(aims.u) <= set(c.u) and c.converged]
        chosen = [c for c in able if c.model == choice.chosen]
        usual = _still_possible(able, former)
        best = min(usual or chosen or able, key=lambda c: c.bic, default=None)
        contested = bool(usual and chosen) and physics(chosen[0].model) != physics(former)
        return cls(choice, best, contested)

    @property
    def model(self) -> str:
        """Name of the chosen model, empty without one."""
        return "" if self.choice is None else self.choice.chosen or ""

    @property
    def verdict(self) -> str:
        """The verdict on it, empty without a fit."""
        return "" if self.choice is None else self.choice.verdict

    def u(self, aims: Aims) -> dict[str, float | None]:
        """Return the u of each parameter asked for; None where the chosen model gives none."""
        best = None if self.choice is None else self.choice.best
        return {name: None if best is None else best.u.get(name) for name in aims.u}


def _still_possible(able: Sequence[FitResult], former: str) -> list[FitResult]:
    """Return the fits of the former leader that no very strong evidence is against.

    By chance another model is chosen for a batch or two; points for that one would be wasted.
    """
    least = min((c.bic for c in able), default=0.0)
    own = [c for c in able if physics(c.model) == physics(former)]
    return [c for c in own if c.bic < least + _VERY_STRONG]


def usual_model(batches: Sequence[Batch]) -> str:
    """Return the model that was chosen for most batches, of equally many the later one."""
    models = [batch.model for batch in batches if batch.model]
    own = [physics(model) for model in models]
    return max(reversed(models), key=lambda model: own.count(physics(model)), default="")


def counted(checks: Sequence[Check]) -> Sequence[Check]:
    """Return the checks at resumes where the lamp had jumped at one, else none.

    Otherwise an interruption would change the choices that follow it.
    """
    return checks if any(check.jumped for check in checks) else ()


def closed(readings: Sequence[Reading], layout: Layout, known: Sequence[Step]) -> list[Reading]:
    """Return the readings with the drift check that closes the scan, if it ended after these.

    It is taken to be as the last one: the u of a fit, on which it tells, is then that of the end.
    """
    checks = [step for step in layout.closing(known) if step.kind == "drift"]
    made = [reading for reading in readings if reading.kind == "drift"]
    if not checks or not made:
        return list(readings)
    last = max(made, key=lambda reading: reading.time_s)
    # Not from when the rig was free: that depends on interruptions of the scan.
    time_s = max(reading.time_s for reading in readings) + layout.seconds(checks, known)
    own = (replace(last, step=step.index, time_s=time_s, free_s=time_s) for step in checks)
    return [*readings, *own]


def agreeing(batch: Batch, model: str, verdict: str) -> bool:
    """Return True if the fit that a batch was based on chose the same physics, the same verdict."""
    return (physics(batch.model), batch.verdict) == (physics(model), verdict)


def corrections(batches: Sequence[Batch], fitted: Mapping[str, float | None]) -> dict[str, float]:
    """Return the ratio of the last full fit's u to the quick fit's, 1 or more, by name.

    Both to the same readings: the quick fit is that on which the batch after the check is based;
    `fitted`: its u where that batch is being chosen now.
    """
    checks = [k for k, batch in enumerate(batches) if batch.checked]
    if not checks:
        return {}
    after = batches[checks[-1] + 1 :]
    quick_u = after[0].fitted if after else fitted
    pairs = ((n, full, quick_u.get(n)) for n, full in batches[checks[-1]].checked.items())
    return {name: max(full / quick, 1.0) for name, full, quick in pairs if full and quick}


def full_fit(rows: Rows, loaded: Loaded, aims: Aims) -> tuple[str, Mapping[str, float | None]]:
    """Return the model that the run's own fit chooses, and the u that it will state."""
    rows = rows._replace(checks=counted(rows.checks))
    fitted = fit_run(reduced_rows(rows, loaded), loaded)
    chosen = fitted.chosen
    if chosen is None:
        return "", dict.fromkeys(aims.u)
    return chosen.model, {name: chosen.u.get(name) for name in aims.u}
