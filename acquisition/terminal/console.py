"""What a person sees in the terminal: the plan, the progress, the result."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from acquisition.engine.frame_files import kept_bytes
from acquisition.plan.plan import Plan, Step, lamp_settings
from instrument.config.load import Loaded
from instrument.text.terminal_safe import escape_control_characters

if TYPE_CHECKING:
    from acquisition.results.finish import Outcome


class _Harmless(Console):
    """Shows names as they are: no markup in them, and no commands to the terminal."""

    def render_str(self, text: str, **how: Any) -> Text:
        """Text for the terminal."""
        return super().render_str(escape_control_characters(text), **how)


# Progress and prompts go to standard error: standard output may be JSON.
console = _Harmless(stderr=True, markup=False, emoji=False)
out = _Harmless(markup=False, emoji=False)


def ask(question: str) -> str:
    """What somebody at the terminal answers, without blanks about it. Raises `EOFError`."""
    console.print(question, end=" ", highlight=False, soft_wrap=True)
    return console.input("").strip()


def duration_text(seconds: float) -> str:
    """Seconds as an operator would say it."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


@contextmanager
def progress(plan: Plan, done: frozenset[int]) -> Iterator[Callable[[Step], None]]:
    """A bar over the planned time, with the time left; yields what to call after each step."""
    columns = (
        TextColumn("{task.description:30}"),
        BarColumn(),
        TextColumn("{task.fields[count]}"),
        TextColumn("time left"),
        TimeRemainingColumn(compact=True),
    )
    ready, total = len(done), len(plan.steps)
    start_s = int(sum(step.duration_s for step in plan.steps if step.index in done))
    planned_s = sum(step.duration_s for step in plan.steps)
    with Progress(*columns, console=console) as bar:
        task = bar.add_task(
            "homing, darks", total=planned_s, completed=start_s, count=f"{ready}/{total}"
        )

        def on_step(step: Step) -> None:
            nonlocal ready
            ready += 1
            count = f"{ready}/{total}"
            bar.update(task, advance=step.duration_s, description=_where(step), count=count)

        yield on_step


def _where(step: Step) -> str:
    what = {"point": "", "tile": "white tile ", "drift": "drift check "}[step.kind]
    return f"{what}θ_i {step.pose.theta_i:g}° θ_r {step.pose.theta_r:g}°"


def print_plan(loaded: Loaded, plan: Plan) -> None:
    """What the scan would do, before it does it."""
    out.print(f"{loaded.protocol.name}: {loaded.protocol.description}", highlight=False)
    table = Table("", "", show_header=False, box=None)
    for row in _plan_rows(loaded, plan):
        table.add_row(*row)
    out.print(table)
    lamp = Table("lamp", "theta_i (deg)", "dphi (deg)", "points", "view angles (deg)")
    seen: dict[int, list[float]] = {}
    for step in plan.points:
        seen.setdefault(step.lamp_setting, []).append(step.pose.theta_r)
    for number, theta_i, dphi in lamp_settings(plan):
        views = seen.get(number, [])
        span = f"{min(views):g} … {max(views):g}" if views else ""
        lamp.add_row(str(number + 1), f"{theta_i:g}", f"{dphi:g}", str(len(views)), span)
    out.print(lamp)


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
    yield (
        "operator",
        f"places sample or tile {plan.swaps} times, sets the lamp {plan.hand_settings} times"
        + (", covers it once" if plan.darks_first_s else ""),
    )
    if loaded.protocol.keep_frames:
        yield "frames", f"all kept, {kept_bytes(plan, loaded) / 1e6:.0f} MB"
    yield "duration", f"about {duration_text(plan.duration_s)}"


def print_outcome(outcome: Outcome) -> None:
    """Which model was chosen, its parameters with uncertainty, and where the report is."""
    from acquisition.results.summary import value_text

    out.print(outcome.headline, highlight=False)
    if outcome.parameters:
        table = Table("parameter", "value ± u (k = 1)")
        for parameter in outcome.parameters:
            table.add_row(parameter.name, value_text(parameter))
        out.print(table)
    for note in outcome.notes:
        out.print(f"- {note}", highlight=False)
    out.print(f"report: {outcome.report}", highlight=False, soft_wrap=True)
