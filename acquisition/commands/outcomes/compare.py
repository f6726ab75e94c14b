"""Command `gonio compare`: whether runs agree, their levels, and how far they repeat."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from json import dumps
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.results.sources import Source, Wanted, read_source
from acquisition.terminal.console import out, print_lines, print_notes, print_text
from acquisition.terminal.layout import table_lines
from acquisition.terminal.progress import sign_of_life
from analysis.choice.choice import choose
from analysis.comparison.agreement import Test, Values, agreement
from analysis.comparison.common_geometries import SAME_DEG, common_geometries
from analysis.comparison.compared import Compared, level_text
from analysis.comparison.levels import on_one_level
from analysis.comparison.page import comparison_html
from analysis.data.covariance import LAMP_LEVEL, Covariance, full_covariance
from analysis.fit.certificate import CERTIFICATE
from analysis.fit.relative_scale import normalise_lamp_levels
from instrument.errors import InputError
from instrument.geometry import BoolArray, IntArray
from instrument.text.atomic_file import write_whole
from instrument.text.quoting import printable


def compare_sources(paths: Sequence[Path], page: Path | None, *, as_json: bool) -> None:
    """Compare two or more runs or tables at the geometries that all have, and print the outcome.

    page: file for the same with charts, in HTML. Raises `InputError` for fewer than two sources,
    for one without u, and for sources that have no geometry in common.
    """
    _check(paths, page)
    sources = [_source(path) for path in paths]
    measured = [source.measurements for source in sources]
    common = common_geometries(measured)
    if not common[0].size:
        raise InputError(
            f"no geometry is common to all, within {SAME_DEG:g} degrees: measure the same angles"
        )
    same = same_tile(sources)
    runs = [_values(source, kept) for source, kept in zip(sources, common, strict=True)]
    relative = tuple(m.relative for m in measured)
    if any(relative):
        runs = _shapes(runs, relative)
    found = Compared(
        names=tuple(printable(path.name or str(path)) for path in paths),
        samples=tuple(printable(source.sample) for source in sources),
        points=tuple(m.size for m in measured),
        at=measured[0].subset(_mask(common[0], measured[0].size)),
        brdf=np.stack([run.brdf for run in runs]),
        agreement=agreement(runs, (CERTIFICATE,) if same else ()),
        same_tile=same,
        relative=relative,
    )
    _require_a_shape(found)
    if page is not None:
        write_whole(page, comparison_html(found))
    if as_json:
        sys.stdout.write(dumps(_json(found), allow_nan=False) + "\n")
    else:
        _print(found)


def _check(paths: Sequence[Path], page: Path | None) -> None:
    if len(paths) < 2:
        raise InputError("gonio compare: name two or more runs, or tables with u_brdf")
    resolved = [path.resolve() for path in paths]
    if len(set(resolved)) < len(resolved):
        raise InputError("gonio compare: a run is named twice; name each once")
    if page is not None and page.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{page}: --out must end in .html")


def _source(path: Path) -> Source:
    """Read a source whose values can be compared."""
    source = read_source(path, Wanted())
    if source.measurements.u_random is None:
        raise InputError(f"{path}: states no uncertainty: add a column u_brdf, in 1/sr")
    return source


def same_tile(sources: Sequence[Source]) -> bool:
    """Return True if one white tile gave all sources their scale, at the same settings of the lamp.

    The errors of its certificate are then the same in all.
    """
    first, settings = sources[0].tile, [_settings(source) for source in sources]
    alike = all(source.tile == first for source in sources)
    return first is not None and alike and all(found == settings[0] for found in settings)


def _settings(source: Source) -> list[tuple[float, float]]:
    m = source.measurements
    pairs = np.stack([m.theta_i_deg, m.dphi_deg], axis=-1).round(3)
    return sorted({(float(i), float(phi)) for i, phi in pairs})


def _values(source: Source, kept: IntArray) -> Values:
    """One source at the geometries that all have; its best model converts errors of angles."""
    m = source.measurements
    with sign_of_life(f"fit of {m.size} points"):
        choice = choose(m, source.acceptance)  # of all models: a poor one hides errors of angles
    best = choice.best
    if best is None:
        raise InputError(f"no model could be fitted, which the comparison needs: {choice.reason}")
    m = normalise_lamp_levels(m, best.brdf)
    whole = full_covariance(m, best.brdf)
    return Values(
        brdf=m.brdf[kept],
        covariance=Covariance(whole.variance[kept], whole.common[kept], whole.names),
        model=best.predicted[kept],
        settings=m.lamp_setting[kept] if m.free_levels else None,
    )


def _shapes(runs: Sequence[Values], relative: tuple[bool, ...]) -> list[Values]:
    """Runs brought to the level of the first absolute one, else to that of the first, as 1."""
    reference = relative.index(False) if False in relative else None
    try:
        return on_one_level(runs, (LAMP_LEVEL, CERTIFICATE), reference)
    except ValueError as error:
        raise InputError(f"gonio compare: {error}; name runs that have measured light") from None


def _require_a_shape(found: Compared) -> None:
    """Raise `InputError` where the unknown levels leave nothing to compare."""
    if found.shape_only and found.agreement.shape.dof < 1:
        raise InputError(
            f"the {found.at.size} geometries that are common to all tell the levels of "
            f"{', '.join(n for n, r in zip(found.names, found.relative, strict=True) if r)} and "
            "nothing else, as no white tile was measured; allowed: two or more at one lamp setting"
        )


def _mask(kept: IntArray, size: int) -> BoolArray:
    mask = np.zeros(size, dtype=np.bool_)
    mask[kept] = True
    return mask


def _print(found: Compared) -> None:
    a, (scatter, expected) = found.agreement, found.repeatability
    print_text(found.headline)
    rows = [
        (name, sample, str(points), level_text(level, u))
        for name, sample, points, level, u in found.runs
    ]
    print_lines(["", *table_lines(("run", "sample", "points", "level ± u"), rows, out.width), ""])
    k, n = found.largest
    free = f"with levels left free: {_test_text(a.shape)}"
    told = (free, found.why_no_level)
    if not found.shape_only:
        tile = "one white tile: the errors of its certificate cancel"
        scales = tile if found.same_tile else "the errors of their scales count as independent"
        told = (f"as they are: {_test_text(a.whole)}; {free}", scales)
    print_notes(
        (
            f"{found.at.size} geometries are common to all",
            *told,
            f"largest difference: {found.names[k]} by {found.difference_in_u[k, n]:+.1f} u at "
            f"{found.angles(n)}",
            f"the runs scatter by {100 * scatter:.3g} % of their mean (rms over the geometries), "
            f"of which independent errors explain {100 * expected:.3g} %",
        )
    )


def _test_text(test: Test) -> str:
    return f"χ² {test.chi2:.4g} with {test.dof} degrees of freedom, p = {test.probability:.3g}"


def _json(found: Compared) -> dict[str, Any]:
    a, (scatter, expected) = found.agreement, found.repeatability
    return {
        "levels_compared": not found.shape_only,
        "agree": None if found.shape_only else a.whole.agrees,
        "agree_in_shape": a.shape.agrees,
        "chi2": None if found.shape_only else a.whole.chi2,
        "dof": None if found.shape_only else a.whole.dof,
        "probability": None if found.shape_only else a.whole.probability,
        "chi2_shape": a.shape.chi2,
        "dof_shape": a.shape.dof,
        "probability_shape": a.shape.probability,
        "same_white_tile": found.same_tile,
        "runs": [
            {"run": name, "sample": sample, "points": points, "level": level, "u_level": u}
            for name, sample, points, level, u in found.runs
        ],
        "repeatability": {"scatter_relative": scatter, "explained_relative": expected},
        "geometries": {
            "theta_i_deg": found.at.theta_i_deg.tolist(),
            "theta_r_deg": found.at.theta_r_deg.tolist(),
            "dphi_deg": found.at.dphi_deg.tolist(),
            "brdf": found.brdf.tolist(),
            "difference": a.difference.tolist(),
            "u_difference": a.u_difference.tolist(),
            "scatter_relative": a.scatter.tolist(),
        },
    }  # fmt: skip
