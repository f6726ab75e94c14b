"""Ends of an adaptive scan: when nothing more is to be measured, and why, in a sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from acquisition.adaptive.aims import Aims
from acquisition.adaptive.chooser import Proposal
from acquisition.adaptive.knowledge import agreeing, corrections
from instrument.record.reading import Batch

_NEAR = 1.05  # u, in units of that by all candidates, from which on more bench time is no help
_SOURCES = 3

U = Mapping[str, float | None]


def stable(batches: Sequence[Batch], proposal: Proposal) -> bool:
    """Return True if the last two fits chose the same model, with the same verdict."""
    known = proposal.known
    return bool(known.model) and agreeing(batches[-1], known.model, known.verdict)


def expected(batches: Sequence[Batch], proposal: Proposal, aims: Aims) -> dict[str, float | None]:
    """Return the forecast u, corrected by what full fits have found so far beside their forecast.

    They average the models over lamp and lens, and correct for what quick fits leave out.
    """
    factors = corrections(batches, proposal.known.u(aims))
    return {
        name: None if u is None else u * factors.get(name, 1.0)
        for name, u in proposal.forecast.items()
    }


def no_help(batches: Sequence[Batch], proposal: Proposal, aims: Aims) -> str:
    """Return that no more bench time can reach the goal, and what could; empty if it can help."""
    now, floor = proposal.forecast, proposal.floor
    if not now or not floor or not stable(batches, proposal):
        return ""
    lost = [n for n in aims.missed(floor) if (now[n] or 0.0) <= _NEAR * (floor[n] or 0.0)]
    if not lost:
        return ""
    name = lost[0]
    return (
        f"no more bench time can help: u({name}) is {_u(now[name])}, wanted {aims.u[name]:g}, and "
        f"every candidate together would give {_u(floor[name])}, {sources_text(proposal, name)}"
    )


def sources_text(proposal: Proposal, name: str) -> str:
    """Return the largest sources of what is left, and what would help."""
    sources = list(proposal.sources.get(name, {}).items())[:_SOURCES]
    parts = ", ".join(f"{100 * part:.0f} % {source}" for source, part in sources)
    return (
        f"of whose variance {parts}; what helps is a smaller u of the first (of noise: more "
        "frames_per_point), or another incidence in the sweeps"
    )


def reached(aims: Aims, u: U) -> str:
    """Return that the goal is reached."""
    return f"the goal is reached: {u_text(aims, u)}"


def out_of_time(batches: Sequence[Batch], proposal: Proposal, aims: Aims) -> str:
    """Return that the next batch would exceed the budget."""
    minutes = (aims.budget_s or 0.0) / 60
    u = expected(batches, proposal, aims)
    missed = aims.missed(u)
    text = f"the next batch would exceed the budget of {minutes:g} min: {u_text(aims, u)}"
    name = next((n for n in missed if (proposal.floor.get(n) or 0.0) > aims.u[n]), None)
    if name is None:
        return text
    floor = proposal.floor[name]
    return (
        f"{text}; more time alone would not do, every candidate together would give a u({name}) of "
        f"{_u(floor)}, {sources_text(proposal, name)}"
    )


def all_measured(batches: Sequence[Batch], proposal: Proposal, aims: Aims) -> str:
    """Return that every candidate that can be reached is measured."""
    u = expected(batches, proposal, aims)
    return f"every candidate is measured: {u_text(aims, u)}; allow more by denser sweeps"


def u_text(aims: Aims, u: U) -> str:
    """Return the u of each parameter beside the one wanted."""
    return ", ".join(f"u({n}) {_u(u.get(n))}, wanted {wanted:g}" for n, wanted in aims.u.items())


def _u(u: float | None) -> str:
    return "not known" if u is None else f"{u:.2g}"
