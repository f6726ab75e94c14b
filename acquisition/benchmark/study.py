"""Study: one question put to several methods in one or more scenes, answered by trials."""

from __future__ import annotations

from dataclasses import dataclass

from acquisition.benchmark.trial import Trial, select


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """Trials with the texts of their chart.

    name: stem of its files, lower case. cost_axis, error_axis: axis labels with the unit.
    caption: two lines on what the chart shows. truth: reference of the errors.
    error_is: meaning of `Trial.error` in a word ("worst", "rms"). joined: the trials of a series
    are steps of one quantity; the chart joins them by a line and labels only the default.
    """

    name: str
    title: str
    cost_axis: str
    error_axis: str
    caption: str
    truth: str
    trials: tuple[Trial, ...]
    error_is: str = "worst"
    joined: bool = False

    def __post_init__(self) -> None:
        seen: set[tuple[str, str]] = set()
        for trial in self.trials:
            key = (trial.scene, trial.label)
            if trial.study != self.name:
                raise ValueError(f"{self.name}: a trial of the study {trial.study!r}")
            if key in seen:
                raise ValueError(f"{self.name}: two trials {trial.label!r} in {trial.scene!r}")
            seen.add(key)

    @property
    def scenes(self) -> tuple[str, ...]:
        """Names of the scenes, in order of appearance."""
        return tuple(dict.fromkeys(trial.scene for trial in self.trials))

    @property
    def series(self) -> tuple[str, ...]:
        """Names of the series, in order of appearance."""
        return tuple(dict.fromkeys(trial.series for trial in self.trials))

    def in_scene(self, scene: str) -> list[Trial]:
        """Return the trials of one scene."""
        return select(self.trials, scene=scene)
