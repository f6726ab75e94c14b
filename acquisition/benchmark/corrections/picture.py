"""Chart of what each correction is worth: error with all of them, and without each in turn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from acquisition.benchmark.corrections.worth import ALL, BANDS_DEG, WITH, WITHOUT, Worth, worth
from acquisition.benchmark.output.axes_grid import axes_grid
from acquisition.benchmark.result import MapPicture
from analysis.report.style import GREY, INK, style_of, svg_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CALIBRATED = "all corrections"
_TITLE = "What each correction is worth"


def corrections_picture(benches: int) -> MapPicture:
    """Measure so many drawn benches with each set of corrections, and draw the errors."""
    sets = {_CALIBRATED: ALL, **WITHOUT, **WITH}
    return picture_of({name: worth(one, benches) for name, one in sets.items()}, benches)


def picture_of(found: Mapping[str, Worth], benches: int) -> MapPicture:
    """Draw the errors of each set of corrections, by its name; `_CALIBRATED` is that with all."""
    rows = _rows(found)

    def draw(figure: Figure) -> None:
        panels = axes_grid(
            figure, 1, len(BANDS_DEG), top_in=0.7, left=0.225, wspace=0.06, share_y=True
        )
        for number, (ax, band) in enumerate(zip(panels, BANDS_DEG, strict=True)):
            _draw_band(ax, found, rows, band)
            if number == 0:
                ax.set_yticks(range(len(rows)), rows)
            ax.set_title(f"|θᵣ| {band[0]:g} to {band[1]:g}°", color=INK, loc="left", pad=4)
        figure.legend(
            *panels[0].get_legend_handles_labels(), loc="upper center", ncols=2, frameon=False,
            fontsize=9, borderaxespad=0.2,
        )  # fmt: skip

    caption = (
        f"BRDF of three samples at three incidences on {benches} benches like bench_real.yaml, "
        "whose defects were drawn anew; root mean square over all points. The line is the error "
        "with all corrections, a dot the error without one of them (hollow: with one more), a "
        "square how much that one changes the values. The tile’s certificate is taken as exact.\n"
        "A correction pays where its dot is to the right of the line. Where only its square nears "
        "the line, it removes a bias that the other errors hide in a single scan."
    )
    return MapPicture(_TITLE, caption, svg_of(4.6, draw, "corrections"), _columns(found))


def _rows(found: Mapping[str, Worth]) -> list[str]:
    """Names of the corrections, that worth most at the top; those beyond all below."""
    last = BANDS_DEG[-1]
    without = sorted((n for n in WITHOUT if n in found), key=lambda n: found[n].rms(last))
    return [*(n for n in WITH if n in found), *without]


def _draw_band(
    ax: Axes, found: Mapping[str, Worth], rows: list[str], band_deg: tuple[float, float]
) -> None:
    base = 100 * found[_CALIBRATED].rms(band_deg)
    colour, marker, _ = style_of(0)
    ax.axvline(base, color=INK, linewidth=1.0, label="error with all corrections")
    for kind, label, face in (
        (WITHOUT, "error without this one", colour),
        (WITH, "error with this one too", "white"),
    ):
        names = [name for name in rows if name in kind]
        at, errors = [rows.index(n) for n in names], [100 * found[n].rms(band_deg) for n in names]
        ax.hlines(at, base, errors, color=GREY, linewidth=0.9, zorder=1)
        ax.plot(
            errors, at, marker, color=colour, markersize=6, label=label,
            markerfacecolor=face, linestyle="none",
        )  # fmt: skip
    colour, marker, _ = style_of(1)
    changes = [100 * found[n].change(found[_CALIBRATED], band_deg) for n in rows]
    ax.plot(
        changes, range(len(rows)), marker, color=colour, markersize=4.5,
        label="change of the values by it", linestyle="none",
    )  # fmt: skip
    ax.set_xscale("log")
    ax.set_xlim(0.01, 9.0)
    ax.set_xticks([0.01, 0.1, 1], ["0.01", "0.1", "1"])
    ax.set_ylim(-0.6, len(rows) - 0.4)
    ax.set_xlabel("of the BRDF, rms (%)")


def _columns(found: Mapping[str, Worth]) -> Mapping[str, list[float | str]]:
    """Names and figures, a row for each set of corrections and band."""
    rows = list(_figures(found))
    names = (
        "corrections", "from_theta_r_deg", "to_theta_r_deg", "rms_percent", "bias_percent",
        "change_percent",
    )  # fmt: skip
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def _figures(found: Mapping[str, Worth]) -> Iterator[tuple[str | float, ...]]:
    for name, one in found.items():
        words = {**dict.fromkeys(WITHOUT, "without "), **dict.fromkeys(WITH, "with ")}
        for band in BANDS_DEG:
            figures = one.rms(band), one.bias(band), one.change(found[_CALIBRATED], band)
            yield f"{words.get(name, '')}{name}", *band, *(100 * figure for figure in figures)
