"""Commands `gonio plan --optimal N` and `--until GOAL`: the geometries that teach most."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from acquisition.commands.planning.chart import FORMATS, Curves, chart
from acquisition.commands.planning.view import optimal_json, print_optimal
from acquisition.design.assumed_sample import assumed_sample
from acquisition.design.fewest import fewest
from acquisition.design.forecast import asked_parameters
from acquisition.design.geometries import settings_of
from acquisition.design.goal import goal_of
from acquisition.design.optimal_plan import OptimalPlan, Planned, Planner
from acquisition.design.protocol_file import protocol_text
from acquisition.results.model_check import check_model
from acquisition.terminal.console import console
from acquisition.terminal.progress import sign_of_life
from instrument.config.load import load_protocol
from instrument.errors import InputError
from instrument.text.atomic_file import write_whole

_CURVE = 8  # plans of a curve in the chart


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimalOptions:
    """Options of `gonio plan --optimal`: how many geometries, for which parameters and sample.

    until: goal in place of a count. out: protocol to write; chart: picture to write.
    """

    count: int | None = None
    until: str | None = None
    wanted: str | None = None
    like: str | None = None
    out: Path | None = None
    chart: Path | None = None


def show_optimal_plan(
    protocol_path: Path, rig_path: Path | None, options: OptimalOptions, *, as_json: bool
) -> None:
    """Choose the geometries, print them with the u that they will give, and write the files.

    Raises `InputError` before anything is written.
    """
    _check_files(options)
    loaded = load_protocol(protocol_path, rig_path, check_model=check_model)
    if loaded.protocol.motion == "fly":
        raise InputError(
            f"{protocol_path}: motion: fly: a turning axis does not stop at chosen geometries; "
            "allowed: stepped"
        )
    sample = assumed_sample(options.like, loaded)
    goal = None if options.until is None else goal_of(options.until, sample, loaded)
    asked = asked_parameters(options.wanted, sample, loaded) if goal is None else list(goal.u)
    with sign_of_life("choosing geometries"):
        planner = Planner.of(loaded, sample, asked, options.count, goal)
        found = _found(planner, options.count)
        files = dict(_files(planner, found, options))
    for path, (content, new) in files.items():
        write_whole(path, content, new=new)
    if as_json:
        sys.stdout.write(json.dumps(optimal_json(found), allow_nan=False) + "\n")
    else:
        print_optimal(found)
    for path in files:
        console.print(f"written: {path}", highlight=False, soft_wrap=True)


def _found(planner: Planner, count: int | None) -> OptimalPlan:
    """Return the plan of so many geometries, or of the fewest that reach the planner's goal."""
    if count is not None:
        return planner.optimal(count)
    if planner.goal is None:
        raise ValueError("neither a count nor a goal; allowed: one of them")
    return fewest(planner, planner.goal)


def _check_files(options: OptimalOptions) -> None:
    out, picture = options.out, options.chart
    if out is not None and out.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(f"{out}: --out is the protocol to write; allowed: a name with .yaml")
    if out is not None and out.exists():
        raise InputError(f"{out}: exists already: choose another name")
    if picture is not None and picture.suffix.lower() not in FORMATS:
        raise InputError(f"{picture}: --chart must end in {', '.join(FORMATS)}")
    for path in filter(None, (out, picture)):
        if not path.parent.is_dir():
            raise InputError(f"{path}: there is no folder {path.parent}; make it first")


def _files(
    planner: Planner, found: OptimalPlan, options: OptimalOptions
) -> Iterator[tuple[Path, tuple[str | bytes, bool]]]:
    """Yield the path of each file to write, its content, and True if it may replace none."""
    if options.out is not None:
        text = protocol_text(found.chosen.loaded, options.out.parent, list(_comments(found)))
        yield options.out, (text, True)
    if options.chart is not None:
        kind = FORMATS[options.chart.suffix.lower()]
        yield options.chart, (chart(_curves(planner, found), kind), False)


def _comments(found: OptimalPlan) -> Iterator[str]:
    option = "--optimal" if found.goal is None else f"--until {found.goal.text}"
    yield (
        f"{len(found.reasons)} geometries for {', '.join(found.asked)}, chosen by gonio plan "
        f"{option} from {found.chosen.loaded.protocol_path.name}"
    )
    yield f"for a sample like {found.sample.text}."


def _curves(planner: Planner, found: OptimalPlan) -> Curves:
    """Plans of rising size, chosen and uniform, up to the protocol's own."""
    most = min(len(planner.points), max(len(found.sweeps.plan.points), len(found.reasons)))
    least = len(planner.every.x)
    sizes = [n for n in _sizes(least, most) if n != len(found.reasons)]
    chosen = _possible(lambda n: planner.chosen(n)[1], sizes)
    views = max(map(len, settings_of(planner.own).values()))
    uniform = _possible(planner.uniform, _sizes(2, max(views, 2)))
    return Curves(
        found=found,
        chosen=_by_time([*chosen, found.chosen]),
        uniform=_by_time(uniform),
    )


def _possible(plan: Callable[[int], Planned], sizes: list[int]) -> list[Planned]:
    """Return the plans of these sizes; a keep-out zone may bar some, of which there is no point."""
    found = []
    for size in sizes:
        with suppress(InputError):
            found.append(plan(size))
    return found


def _by_time(plans: list[Planned]) -> tuple[Planned, ...]:
    return tuple(sorted(plans, key=lambda planned: planned.minutes))


def _sizes(least: int, most: int) -> list[int]:
    """Return numbers from the least to the most in about equal ratios."""
    ratio = (most / least) ** (1 / (_CURVE - 1))
    return sorted({round(least * ratio**k) for k in range(_CURVE)})
