"""All studies of the benchmark, in the order of the page."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from acquisition.benchmark.effort import Effort
from acquisition.benchmark.studies.camera_bits import bits_study
from acquisition.benchmark.studies.fit_methods import fit_studies
from acquisition.benchmark.studies.reflectance import beckmann_study, rough_study, wolff_study
from acquisition.benchmark.studies.scan import scan_study
from acquisition.benchmark.studies.window_methods import window_studies
from acquisition.benchmark.study import Study

_STEPS: tuple[tuple[str, Callable[[Effort], tuple[Study, ...]]], ...] = (
    ("rough diffuse surface", lambda effort: (rough_study(effort),)),
    ("smooth dielectric", lambda effort: (wolff_study(effort),)),
    ("physical optics", lambda effort: (beckmann_study(effort),)),
    ("measuring window", window_studies),
    ("fit", fit_studies),
    ("simulated scans", lambda effort: (scan_study(effort),)),
    ("camera bits", lambda effort: (bits_study(effort),)),
)


def studies(effort: Effort, tell: Callable[[str], None]) -> Iterator[Study]:
    """Measure one study after the other; `tell` is called with the name of each before it."""
    for number, (words, measure) in enumerate(_STEPS, start=1):
        tell(f"{number}/{len(_STEPS)} {words}")
        yield from measure(effort)
