"""Protocol of an adaptive scan: its sweeps are the candidates, and it states the goal."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from acquisition.design.geometries import candidate_plan
from acquisition.design.goal import wanted_u
from acquisition.design.protocol_file import protocol_text
from acquisition.plan.plan import make_plan
from instrument.config.load import Loaded
from instrument.config.protocol import GoalConfig
from instrument.config.yaml_positions import place, read_yaml
from instrument.errors import InputError


def with_goal(loaded: Loaded, until: str | None, budget_min: float | None) -> Loaded:
    """Return the protocol with the goal and the budget of the options in place of its own.

    Raises `InputError` for a text that is no goal, and for a budget without one or of no time.
    """
    goal = loaded.protocol.goal
    if until is not None:
        goal = {name: GoalConfig.model_construct(u=u) for name, u in wanted_u(until).items()}
    if budget_min is not None and goal is None:
        raise InputError("--budget-min: allowed with --until, or for a protocol with a goal")
    if goal is not None and loaded.protocol.motion == "fly":
        raise InputError(
            f"--until: not for motion: fly in {loaded.protocol_path}; allowed: stepped, as it "
            "chooses single points"
        )
    if budget_min is not None and not 0 < budget_min < math.inf:
        raise InputError(f"--budget-min {budget_min:g}; allowed: minutes, more than 0")
    budget = loaded.protocol.budget_min if budget_min is None else budget_min
    changed = loaded.protocol.model_copy(update={"goal": goal, "budget_min": budget})
    return replace(loaded, protocol=changed)


def goal_of_protocol(loaded: Loaded) -> Mapping[str, float]:
    """Return the u wanted of each parameter, in its unit."""
    return {name: wanted.u for name, wanted in (loaded.protocol.goal or {}).items()}


def candidate_list(loaded: Loaded) -> Loaded:
    """Return the protocol of a scan with a goal, whose sweeps hold every candidate.

    They are the geometries of the given sweeps and those halfway between their views. Its text is
    what the run keeps: planned again, it gives the same list.
    """
    finer = candidate_plan(loaded, make_plan(loaded))[0]
    stated = {"goal": {name: {"u": u} for name, u in goal_of_protocol(loaded).items()}}
    budget = loaded.protocol.budget_min
    more = stated if budget is None else {**stated, "budget_min": budget}
    comments = [
        f"candidates of an adaptive scan: the sweeps of {loaded.protocol_path.name}, and the",
        "geometries halfway between their views",
    ]
    folder = loaded.protocol_path.parent
    text = protocol_text(finer, folder, comments, name=loaded.protocol.name, more=more)
    return replace(finer, protocol_text=text)


def where(loaded: Loaded, name: str) -> str:
    """Return the place of a parameter's goal, for a message: in the file, else the option."""
    if ("goal", name) not in read_yaml(loaded.protocol_text.encode()).values:
        return f"--until {name}"
    return place(loaded.protocol_path, loaded.protocol_text, ("goal", name))
