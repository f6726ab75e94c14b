"""Terminal views of a plan and of a run's outcome."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from acquisition.commands.determinable import Determinable
from acquisition.engine.frame_files import frame_bytes
from acquisition.plan.plan import Plan
from acquisition.plan.pose import Pose
from acquisition.terminal.console import duration_text, out, print_lines, print_notes, print_text
from acquisition.terminal.layout import table_lines, text_table_lines
from instrument.config.load import Loaded

if TYPE_CHECKING:
    from acquisition.results.finish import Outcome
    from analysis.report.data import Parameter

_MOST_SETTINGS = 12  # of the lamp, that have a row each


def print_plan(loaded: Loaded, plan: Plan) -> None:
    """Print the plan's totals and its view angles for each lamp setting."""
    print_text(f"{loaded.protocol.name}: {loaded.protocol.description}")
    print_lines([*text_table_lines(list(_plan_rows(loaded, plan)), out.width), ""])
    header = ("setting", "theta_i (deg)", "dphi (deg)", "points", "view angles (deg)")
    print_lines(table_lines(header, list(_lamp_rows(plan)), out.width))


def _lamp_rows(plan: Plan) -> Iterator[tuple[str, ...]]:
    """Rows of the lamp settings; of many, those in a row with the same view angles are one."""
    views_deg: dict[int, list[float]] = {}
    for step in plan.points:
        views_deg.setdefault(step.lamp_setting, []).append(step.pose.theta_r)
    poses = sorted({step.lamp_setting: step.pose for step in plan.steps}.items())
    turning = len({pose.dphi for _, pose in poses}) > len({pose.theta_i for _, pose in poses})

    def key(setting: tuple[int, Pose]) -> object:
        number, pose = setting
        fixed = pose.theta_i if turning else pose.dphi
        return (fixed, views_deg.get(number)) if len(poses) > _MOST_SETTINGS else number

    for _, members in groupby(poses, key):
        group = list(members)
        own = views_deg.get(group[0][0], [])
        lamps, theta_i = [n + 1 for n, _ in group], [pose.theta_i for _, pose in group]
        spans = (_span(theta_i), _span([pose.dphi for _, pose in group]))
        yield f"lamp {_span(lamps)}", *spans, str(len(own) * len(group)), _span(own)


def _span(values: Sequence[float]) -> str:
    """Smallest and largest of the values, the one that all are, or nothing."""
    ends = dict.fromkeys((min(values), max(values))) if values else ()
    return " … ".join(f"{end:g}" for end in ends)


def _plan_rows(loaded: Loaded, plan: Plan) -> Iterator[tuple[str, str]]:
    tiles = sum(step.kind == "tile" for step in plan.steps)
    drifts = sum(step.kind == "drift" for step in plan.steps)
    yield "rig", f"{loaded.rig.name} ({loaded.rig.kind})"
    yield "geometries", f"{len(plan.points)} to measure"
    hidden = ", ".join(f"({p.theta_i:g}, {p.dphi:g}, {p.theta_r:g})" for p in plan.hidden[:6])
    more = " …" if len(plan.hidden) > 6 else ""
    yield (
        "left out",
        f"{len(plan.hidden)} where camera and lamp hide one another"
        + (f": (theta_i, dphi, theta_r) = {hidden}{more}" if hidden else ""),
    )
    yield "references", f"{tiles} white tile, {drifts} drift checks"
    determinable = Determinable.of(loaded.protocol, [step.pose for step in plan.points])
    if determinable.no:
        can = f"it can determine {', '.join(determinable.yes)}"
        yield (
            "no white tile",
            f"radiance is relative: the fit will not determine {', '.join(determinable.no)}; "
            + (can if determinable.yes else "it needs two or more views at each lamp setting"),
        )
    yield (
        "operator",
        f"places sample or tile {plan.swaps} times, sets the lamp {plan.hand_settings} times"
        + (", covers it once" if plan.darks_first_s else ""),
    )
    flights = len({step.flight for step in plan.points} - {None})
    if flights:
        turns = f"{flights} steady turn{'s' * (flights > 1)}"
        yield "motion", f"{turns} of theta_r, a frame at each angle on the way"
    if loaded.protocol.keep_frames:
        yield "frames", f"all kept, {frame_bytes(plan, loaded) / 1e6:.0f} MB"
    yield "duration", f"about {duration_text(plan.duration_s)}"


def print_outcome(outcome: Outcome) -> None:
    """Print the chosen model, its parameters with uncertainty, notes and the report's path."""
    print_text(outcome.headline)
    if outcome.parameters:
        print_lines(["", *parameter_lines(outcome.parameters, out.width), ""])
    print_notes(outcome.notes)
    out.print(f"report: {outcome.report}", highlight=False, soft_wrap=True)


def parameter_lines(parameters: Sequence[Parameter], width: int) -> list[str]:
    """Return a table of parameters with their uncertainties as lines."""
    from acquisition.results.summary import value_text  # heavy: only after a scan

    rows = [(p.name, value_text(p)) for p in parameters]
    return table_lines(("parameter", "value ± u (k = 1)"), rows, width, right=False)
