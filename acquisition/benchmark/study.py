"""One question put to several methods, in one or several scenes, and its answer in trials."""

from __future__ import annotations

from dataclasses import dataclass

from acquisition.benchmark.trial import Trial


@dataclass(frozen=True, slots=True)
class Study:
    """Trials with what their chart says.

    name: of its files, lower case. cost_axis, error_axis: with the unit, as on the chart.
    caption: two lines on what to read off the chart. truth: what the errors are errors of.
    error_is: what `Trial.error` is, in a word ("worst", "rms"). joined: the trials of a series are
    steps of one quantity: the chart joins them by a line and names only the default.
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
        """The scenes in order."""
        return tuple(dict.fromkeys(trial.scene for trial in self.trials))

    @property
    def series(self) -> tuple[str, ...]:
        """The series in order."""
        return tuple(dict.fromkeys(trial.series for trial in self.trials))

    def of(self, scene: str) -> tuple[Trial, ...]:
        """The trials of one scene."""
        return tuple(trial for trial in self.trials if trial.scene == scene)

    def named(self, scene: str, label: str) -> Trial:
        """One trial. Raises `KeyError` that lists the labels of the scene."""
        for trial in self.of(scene):
            if trial.label == label:
                return trial
        known = ", ".join(trial.label for trial in self.of(scene))
        raise KeyError(f"{self.name}: no {label!r} in {scene!r}; there are: {known or 'none'}")
