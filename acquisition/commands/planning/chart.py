"""Chart of bench minutes against u: chosen geometries beside even sweeps."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

from acquisition.commands.planning.view import UNITS
from acquisition.design.optimal_plan import OptimalPlan, Planned
from analysis.report.style import GREY, INK, Drawing, drawn_in, style_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = {".png": "png", ".svg": "svg", ".pdf": "pdf"}
"""Format of a picture by the ending of its name."""

_MOST_PANELS = 3
_DPI = 150


@dataclass(frozen=True, slots=True, kw_only=True)
class Curves:
    """Plans of rising time: chosen geometries, and even sweeps; `found` is marked among them."""

    found: OptimalPlan
    chosen: tuple[Planned, ...]
    uniform: tuple[Planned, ...]


def chart(curves: Curves, kind: str) -> bytes:
    """Return the chart as a picture of that format, a panel for each parameter asked for."""
    from matplotlib.figure import Figure

    figure = drawn_in(Figure, Drawing(3.9, lambda figure: _draw(figure, curves)))
    data = io.BytesIO()
    nothing = {"Date": None} if kind == "svg" else {"CreationDate": None} if kind == "pdf" else None
    figure.savefig(data, format=kind, dpi=_DPI, metadata=nothing)
    return data.getvalue()


def _draw(figure: Figure, curves: Curves) -> None:
    names = curves.found.asked[:_MOST_PANELS]
    axes = figure.subplots(1, len(names), squeeze=False)[0]
    for ax, name in zip(axes, names, strict=True):
        _panel(ax, curves, name)
    axes[0].set_ylabel("u, in the parameter's unit (k = 1)")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=len(labels), frameon=False, fontsize=9)
    figure.subplots_adjust(left=0.085, right=0.985, bottom=0.14, top=0.83, wspace=0.25)


def _log_axis(ax: Axes) -> None:
    """Set a logarithmic axis with plain numbers at 1, 2 and 5."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    ax.set_yscale("log")
    low, high = ax.get_ylim()
    ax.set_ylim(low / 1.15, high * 1.15)
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.6g}"))
    ax.yaxis.set_minor_locator(NullLocator())


def _panel(ax: Axes, curves: Curves, name: str) -> None:
    parameters = {p.name: p for p in curves.found.sample.model.parameters}
    series = (("chosen geometries", curves.chosen, 0), ("even sweeps", curves.uniform, 1))
    for label, plans, number in series:
        colour, marker, dashes = style_of(number)
        minutes, u = [p.minutes for p in plans], [p.u[name] for p in plans]
        ax.plot(minutes, u, color=colour, marker=marker, linestyle=dashes, label=label)
    found = curves.found
    for planned, label, symbol in (
        (found.chosen, f"this plan: {len(found.reasons)} geometries", "o"),
        (found.sweeps, f"the protocol: {len(found.sweeps.plan.points)} geometries", "s"),
    ):
        ax.plot(
            [planned.minutes], [planned.u[name]], symbol, label=label, markersize=11,
            markerfacecolor="none", markeredgecolor=INK if symbol == "o" else GREY,
        )  # fmt: skip
    _log_axis(ax)
    unit = UNITS.get(parameters[name].unit, parameters[name].unit)
    ax.set_title(f"{name} ({unit})" if unit else name, loc="left", color=INK, pad=5)
    ax.set_xlabel("bench time (minutes)")
