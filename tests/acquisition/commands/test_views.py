"""Views of a plan and of a fit: at any width of the terminal every number is whole."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from acquisition.commands import fit
from acquisition.commands.views import print_plan
from acquisition.plan.plan import make_plan
from acquisition.results.sources import Wanted
from acquisition.terminal.console import out
from analysis.choice.choice import choose
from analysis.data.csv.table import read_csv
from analysis.models import MODELS
from instrument.config.load import Loaded
from instrument.config.protocol import Steps
from instrument.errors import NotDetermined
from instrument.geometry import Geometry
from tests.support.scans import changed

WIDTHS = range(40, 201, 3)
NUMBER = re.compile(r"[-+(]?[0-9]")


def _printed(show: Callable[[], None], width: int, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    monkeypatch.setattr(out, "_width", width)
    with out.capture() as shown:
        show()
    return shown.get().splitlines()


def _numbers(lines: list[str]) -> list[str]:
    return sorted(word for line in lines for word in line.split() if NUMBER.match(word))


def _assert_whole_at_any_width(show: Callable[[], None], monkeypatch: pytest.MonkeyPatch) -> None:
    wide = _numbers(_printed(show, 1000, monkeypatch))
    assert wide
    for width in WIDTHS:
        lines = _printed(show, width, monkeypatch)
        assert _numbers(lines) == wide
        assert max(map(len, lines)) <= width
        assert "…" not in "".join(lines).replace(" … ", "")


@pytest.mark.parametrize("stated", [True, False])
def test_a_fit_is_printed_whole_at_any_width(
    stated: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Candidates of long names, with differences of BIC from 0 to many thousands."""
    theta_r = np.arange(-75.0, 76.0, 15.0)
    model, random = MODELS["oren_nayar+torrance_sparrow"], np.random.default_rng(5)
    brdf = model.brdf(Geometry.from_degrees(theta_i=50, theta_r=theta_r, dphi=0),
                      albedo=0.8, sigma_deg=20, ks=0.1)  # fmt: skip
    brdf = brdf * (1 + 1e-3 * random.standard_normal(brdf.size))
    path = tmp_path / "table.csv"
    rows = [f"50,{r},0,{f},{f / 1000}" for r, f in zip(theta_r, brdf, strict=True)]
    path.write_text("\n".join(["theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf", *rows]))
    if not stated:
        path.write_text(re.sub(r",[^,]*$", "", path.read_text(), flags=re.MULTILINE))
    names = ["lambert", "oren_nayar+torrance_sparrow", "lambert+ggx", "wolff",
             "oren_nayar_qualitative+torrance_sparrow_lobe+single_scattering"]  # fmt: skip
    choice = choose(read_csv(path), None, names)
    monkeypatch.setattr(fit, "choose", lambda *_, **__: choice)

    def show() -> None:
        with suppress(NotDetermined):
            fit.fit_source(path, fit.Asked(wanted=Wanted()), as_json=False)

    _assert_whole_at_any_width(show, monkeypatch)


def test_a_plan_is_printed_whole_at_any_width(
    demo: Loaded, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = make_plan(demo)
    _assert_whole_at_any_width(lambda: print_plan(demo, plan), monkeypatch)


@pytest.mark.parametrize(("lamps", "rows"), [(12, 12), (31, 1)])
def test_many_lamp_settings_with_the_same_views_are_one_row(
    lamps: int, rows: int, demo: Loaded, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = Steps(start=20.0, stop=75.0, num=lamps)
    sweep = {"theta_r_deg": [80.0], "dphi_deg": [0.0], "theta_i_deg": steps}
    moving = changed(demo, sweeps=[sweep])
    lines = _printed(lambda: print_plan(moving, make_plan(moving)), 80, monkeypatch)
    found = [line.split() for line in lines if line.startswith("lamp ")]
    assert len(found) == rows
    assert " ".join(found[-1]) == ("lamp 1 … 31 20 … 75 0 31 80" if rows == 1 else
                                   "lamp 12 75 0 1 80")  # fmt: skip
