"""Report page: complete, self-contained, and safe for any data."""

from __future__ import annotations

import base64
import errno
import hashlib
import json
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.report.data import Parameter, ReportData
from analysis.report.page import report_html, write_report
from analysis.report.style import CSS, HOVER, format_value, visible
from instrument.errors import StorageError
from instrument.geometry import FloatArray
from instrument.record.reading import Preview
from tests.support.analysis.no_charts import leave_charts_out
from tests.support.analysis.report_data import NAN, data_of, png, svgs, without_tile, words

pytestmark = pytest.mark.charts

HOSTILE = "<script>alert('1')</script>\"&\x00\udc80 $\\frac$"


@pytest.fixture(scope="module")
def page() -> str:
    return report_html(data_of())


class TestPage:
    def test_is_self_contained_and_has_one_script_of_its_own(self, page: str) -> None:
        assert set(re.findall(r"https?://[^\s\"'<)]+", page)) == {"http://www.w3.org/2000/svg"}
        assert set(re.findall(r'(?:src|href)="(.)', page)) <= {"#", "d"}
        assert not re.search(r"<link|@import|url\((?!#)|\son\w+=", page)
        data, own = re.findall(r"<script([^>]*)>(.*?)</script>", page, re.DOTALL)
        assert data[0] == ' type="application/json" id="points"'
        assert own == ("", HOVER)
        assert page.count("<script") == 2

    def test_its_policy_forbids_loading_anything_and_any_other_script(self, page: str) -> None:
        """It comes before all that it governs."""
        policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]+)"', page)
        assert policy is not None
        rules = dict(rule.split(" ", 1) for rule in policy[1].split("; "))
        assert rules["default-src"] == "'none'"
        assert rules["style-src"] == "'unsafe-inline'"
        assert rules["img-src"] == "data:"
        digest = hashlib.sha256(HOVER.encode()).digest()
        assert rules["script-src"] == f"'sha256-{base64.b64encode(digest).decode()}'"
        assert policy.start() < page.index("<title>") < page.index("<style>")

    @pytest.mark.parametrize(
        "section",
        [
            *("verdict", "notes", "shape", "brdf", "polar", "candidates", "budget"),
            *("pictures", "rig", "devices", "versions", "times"),
        ],
    )
    def test_has_section(self, page: str, section: str) -> None:
        assert page.count(f'id="{section}"') == 1

    def test_charts_are_well_formed_and_no_id_is_used_twice(self, page: str) -> None:
        # Three charts in two widths, a bar for each of two rows of the budget, one picture.
        assert len(svgs(page)) == 9
        ids = re.findall(r'\bid="([^"]+)"', page)
        assert len(ids) == len(set(ids))
        assert set(re.findall(r'(?:href="|url\()#([^")]+)', page)) <= set(ids)

    def test_same_data_same_bytes(self, page: str) -> None:
        assert report_html(data_of()) == page

    def test_is_small(self, page: str) -> None:
        assert len(page.encode()) < 300_000

    def test_labels_the_lamp_and_the_error_bars(self, page: str) -> None:
        text = words(page)
        for phrase in ("lamp’s side", "mirror side", "lamp 30°", "(k = 1)", "L(θᵣ) / L(0)", "1/sr"):
            assert phrase in text

    def test_chosen_model_comes_first_with_its_values(self, page: str) -> None:
        assert page.index("oren_nayar", page.index("<tbody>")) < page.index("<tr><td>lambert")
        assert page.count("20.013 ± 0.021\u00a0°") == 2  # in the verdict and in the table
        assert "not determined, in [0, 0.123]" in page
        assert ">692.0<" in page

    def test_on_a_phone_each_number_of_a_candidate_has_the_name_of_its_column(
        self, page: str
    ) -> None:
        """The style sheet names columns 3 to 5, whose head is not shown there."""
        table = page[page.index('<div class="wide candidates">') :]
        head = re.findall(r"<th[^>]*>([^<]*)</th>", table)[:5]
        named = re.findall(r"\.candidates td(\S*)::before {[^}]*content: \"([^\"]*) \"", CSS)
        assert named == [(".number", "rms"), (":nth-child(4)", "χ²/dof"), (":nth-child(5)", "ΔBIC")]
        assert head[2:] == ["Residual, rms", "Reduced χ²", "ΔBIC"]

    def test_long_names_may_wrap(self) -> None:
        model = replace(data_of().candidates[1], name="oren_nayar+torrance_sparrow")
        page = report_html(data_of(verdict=(f"{model.name}: best",), candidates=(model,)))
        assert "oren_<wbr>nayar+<wbr>torrance_<wbr>sparrow: best" in page
        assert "<td>oren_nayar+<wbr>torrance_sparrow" in page

    def test_an_empty_report_has_few_sections(self) -> None:
        none = np.array([])
        columns = ("theta_i_deg", "dphi_deg", "theta_r_deg", "brdf", "u_brdf", "radiance")
        texts = {"title": "t", "sample": "", "description": "", "verdict_kind": ""}
        empty: dict[str, Any] = {**texts, **dict.fromkeys((*columns, "u_radiance"), none)}
        fitted = np.array([], dtype=bool)
        page = report_html(ReportData(verdict=(), notes=(), flags=(), fitted=fitted, **empty))
        assert "No model was fitted." in page
        assert "<svg" not in page


def test_hostile_texts_are_escaped() -> None:
    parameter = Parameter(HOSTILE, 1.0, 0.1, None, HOSTILE)
    model = replace(
        data_of().candidates[0],
        name=HOSTILE,
        parameters=(parameter,),
        chosen=True,
        message=HOSTILE,
    )
    rows = ((HOSTILE, HOSTILE),)
    flags = (HOSTILE, *("",) * 17)
    page = report_html(
        data_of(
            title=HOSTILE,
            sample=HOSTILE,
            description=HOSTILE,
            verdict=(HOSTILE, HOSTILE),
            verdict_kind=HOSTILE,
            notes=(HOSTILE,),
            flags=flags,
            candidates=(model,),
            budget=((HOSTILE, 1.0, 50.0),),
            previews=(Preview(0, HOSTILE, png(), []), Preview(1, HOSTILE, b"no picture", [])),
            rig=rows,
            devices=rows,
            versions=rows,
            times=rows,
        )
    )
    data, own = re.findall(r"<script[^>]*>(.*?)</script>", page, re.DOTALL)
    assert own == HOVER
    assert json.loads(data)[0].endswith(visible(HOSTILE))
    assert page.count("<script") == 2
    assert "\x00" not in page
    assert page.count("&lt;script&gt;alert(&#x27;1&#x27;)") > 25
    assert len(svgs(page)) == 8


class TestFile:
    def test_is_written_completely_without_leftovers(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        leave_charts_out(monkeypatch)
        path = tmp_path / "report.html"
        path.write_text("old")
        write_report(path, data_of(sample="caf\udce9"))  # a file name that was not UTF-8
        assert path.read_text(encoding="utf-8").endswith("</html>\n")
        assert list(tmp_path.iterdir()) == [path]

    def test_a_full_disk_keeps_the_old_report(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = tmp_path / "report.html"
        path.write_text("old")

        def full(*_: object, **__: object) -> None:
            raise OSError(errno.ENOSPC, "no space left on device")

        leave_charts_out(monkeypatch)
        monkeypatch.setattr(os, "replace", full)
        with pytest.raises(StorageError, match=r"report\.html: the disk is full"):
            write_report(path, without_tile())
        assert path.read_text() == "old"
        assert list(tmp_path.iterdir()) == [path]


class TestNoTile:
    def test_shows_relative_radiance_and_notes_it(self) -> None:
        page = report_html(without_tile())
        assert "radiance is relative" in page
        assert "radiance (counts/s)" in page
        assert "BRDF (1/sr)" not in page
        assert 'id="candidates"' not in page


class TestBrokenNumbers:
    @pytest.mark.parametrize("where", ["brdf", "u_brdf", "theta_r_deg", "theta_i_deg", "dphi_deg"])
    def test_bad_numbers_do_not_affect_others(self, where: str) -> None:
        data = data_of((30.0,))
        column = getattr(data, where).copy()
        column[1:6] = NAN, np.inf, -np.inf, 0.0, -1.0
        changes: dict[str, Any] = {where: column}
        page = report_html(replace(data, **changes))
        assert len(svgs(page)) >= 9
        assert "nan" not in words(page).lower()

    def test_no_valid_number(self) -> None:
        data = data_of()
        bad = np.full(len(data.flags), NAN)
        columns: dict[str, Any] = dict.fromkeys(("brdf", "u_brdf", "radiance", "u_radiance"), bad)
        model = replace(
            data.candidates[1],
            parameters=(Parameter("a", NAN, NAN, (NAN, np.inf), ""),),
            rms_relative=NAN,
            reduced_chi2=np.inf,
            bic=NAN,
            residuals=bad,
            curve=lambda _i, _d, theta_r: np.full(np.shape(theta_r), np.nan),
        )
        whole = replace(data, candidates=(model,))
        assert len(svgs(report_html(whole))) == 9
        page = report_html(replace(whole, **columns))
        assert "No geometry has a value to plot." in page

    @pytest.mark.slow
    @pytest.mark.parametrize("seed", range(4))
    def test_numbers_over_600_decades(self, seed: int, slow: bool) -> None:
        """Values, u, parameters and criteria from 1e-300 to 1e300, of either sign, and zeros."""
        if seed > 1 and not slow:
            pytest.skip("with --slow")
        rng = np.random.default_rng(seed)

        def wide(n: int) -> FloatArray:
            return 10.0 ** rng.uniform(-300, 300, n) * rng.choice([1, 1, -1, 0], n)

        data = data_of((30.0,))
        points = len(data.flags)
        value, u, low = wide(8), np.abs(wide(8)), wide(8)
        parameters = tuple(
            Parameter(f"p{n}", value[n], u[n] if n < 6 else None, (low[n], value[n]), "°")
            for n in range(8)
        )
        rms, chi2, bic = wide(3).tolist()
        chosen = replace(
            data.candidates[1],
            parameters=parameters,
            rms_relative=rms,
            reduced_chi2=chi2,
            bic=bic,
            residuals=wide(points - 3),
        )
        flags = ("saturated",) * 3 + ("",) * (points - 3)
        # The charts plot ratios of these, which a float must hold.
        columns: dict[str, Any] = {
            "brdf": np.cbrt(wide(points)),
            "u_brdf": np.cbrt(np.abs(wide(points))),
        }
        fitted = np.array([not flag for flag in flags])
        text = words(
            report_html(replace(data, candidates=(chosen,), flags=flags, fitted=fitted, **columns))
        )
        assert "nan" not in text.lower()
        for parameter in parameters[:6]:
            shown = format_value(parameter.value, parameter.u, parameter.unit)
            assert " ".join(shown.split()) in text

    def test_all_flagged_and_all_zero(self) -> None:
        data = data_of(theta_r=(0.0,))
        nothing, no = np.zeros(2), np.zeros(2, dtype=bool)
        data = replace(data, brdf=nothing, flags=("dark", "dark"), fitted=no, candidates=())
        assert "Flagged points" in report_html(data)


def test_flagged_points_are_listed_and_crossed() -> None:
    data = data_of((30.0,), theta_r=(-30.0, 0.0, 30.0))
    flags = ("", "", "saturated: 3 pixels")
    fitted = np.array([True, True, False])
    model = replace(data.candidates[1], residuals=np.zeros(2))
    page = report_html(replace(data, flags=flags, fitted=fitted, candidates=(model,)))
    assert "saturated: 3 pixels" in page
    assert "<b>1 flagged</b>" in page
    assert "Crosses: flagged points; outliers may lie outside." in page


def test_window_is_drawn_about_the_centres_of_its_pixels(page: str) -> None:
    picture = next(s for s in svgs(page) if s.find("image") is not None)
    outline = picture.find("polygon")
    assert picture.get("viewBox") == "0 0 4 3"
    assert outline is not None
    assert outline.get("points") == "0.50,0.50 3.50,0.50 3.50,2.50"
