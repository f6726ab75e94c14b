"""The report: what it promises to somebody at a bench, whatever the data."""

from __future__ import annotations

import errno
import re
import struct
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from analysis.report.data import Candidate, Parameter, ReportData, sweeps_of
from analysis.report.page import report_html, write_report
from analysis.report.style import format_value
from instrument.errors import StorageError
from instrument.geometry import FloatArray
from instrument.record.reading import Preview

HOSTILE = "<script>alert('1')</script>\"&\x00\udc80 $\\frac$"
NAN = float("nan")


def tilted(theta_i_deg: float, dphi_deg: float, theta_r_deg: FloatArray) -> FloatArray:
    """A BRDF that grows towards the lamp's side, like a rough matte surface."""
    towards = np.sin(np.radians(theta_r_deg)) * np.cos(np.radians(dphi_deg))
    return np.asarray(0.25 + 0.1 * np.sin(np.radians(theta_i_deg)) * towards)


def flat(theta_i_deg: float, dphi_deg: float, theta_r_deg: FloatArray) -> FloatArray:
    return np.full(np.shape(theta_r_deg), 0.25)


def png(width: int = 4, height: int = 3) -> bytes:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return (
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        )

    rows = b"".join(b"\0" + bytes(range(width)) for _ in range(height))
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    parts = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


def data_of(
    incidences: tuple[float, ...] = (30.0, 60.0),
    dphis: tuple[float, ...] = (0.0,),
    theta_r: tuple[float, ...] = tuple(range(-60, 61, 15)),
    **changes: Any,
) -> ReportData:
    rows = [(i, d, r) for d in dphis for i in incidences for r in theta_r]
    theta_i_deg, dphi_deg, theta_r_deg = np.array(rows, dtype=np.float64).T
    brdf = np.array([float(tilted(i, d, np.array(r))) for i, d, r in rows])
    points = len(rows)
    good = Candidate(
        "oren_nayar",
        (
            Parameter("albedo", 0.90123, 0.0021, None, ""),
            Parameter("sigma_deg", 20.01311, 0.0213, None, "°"),
        ),
        rms_relative=0.006,
        reduced_chi2=1.04,
        bic=-812.0,
        converged=True,
        chosen=True,
        residuals=np.linspace(-2, 2, points),
        curve=tilted,
    )
    loose = Parameter("ks", 0.01, None, (0.0, 0.123), "")
    poor = Candidate("lambert", (loose,), 0.1, 96.4, -120.0, True, False, curve=flat)
    data = ReportData(
        title="Wall plaster",
        sample="plaster A",
        description="dry",
        verdict=("Oren and Nayar's model explains the data.", "Nothing more is needed."),
        verdict_kind="adequate",
        notes=("3 geometries hidden",),
        theta_i_deg=theta_i_deg,
        dphi_deg=dphi_deg,
        theta_r_deg=theta_r_deg,
        brdf=brdf,
        u_brdf=0.01 * brdf,
        radiance=1e5 * brdf,
        u_radiance=1e3 * brdf,
        flags=("",) * points,
        fitted=np.ones(points, dtype=bool),
        candidates=(poor, good),
        budget=(("photon noise", 0.17, 62.0), ("white tile", NAN, NAN)),
        previews=(Preview(0, "at 30°", png(), [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0]]),),
        rig=(("lamp", "halogen"),),
        devices=(("stage", "serial 7"),),
        versions=(("gonio", "0.1.0"),),
        times=(("started", "2025-11-21 23:10 UTC"),),
    )
    return replace(data, **changes)


def without_tile() -> ReportData:
    data = data_of()
    none = np.full(len(data.flags), NAN)
    nothing = np.zeros(len(data.flags), dtype=bool)
    return replace(data, brdf=none, u_brdf=none, fitted=nothing, candidates=(), verdict_kind="")


def svgs(page: str) -> list[ElementTree.Element]:
    found = re.findall(r"<svg\b.*?</svg>", page, flags=re.DOTALL)
    return [ElementTree.fromstring(text) for text in found]  # our own text, made above


def words(page: str) -> str:
    return " ".join(re.sub(r"<style>.*?</style>|<[^>]+>", " ", page, flags=re.DOTALL).split())


@pytest.fixture(scope="module")
def page() -> str:
    return report_html(data_of())


class TestPage:
    def test_needs_no_other_file_and_runs_nothing(self, page: str) -> None:
        assert set(re.findall(r"https?://[^\s\"'<)]+", page)) == {"http://www.w3.org/2000/svg"}
        assert set(re.findall(r'(?:src|href)="(.)', page)) <= {"#", "d"}
        assert not re.search(r"<script|<link|@import|url\((?!#)|\son\w+=", page)

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
        # Three charts, a bar for each of two rows of the budget, one picture.
        assert len(svgs(page)) == 6
        ids = re.findall(r'\bid="([^"]+)"', page)
        assert len(ids) == len(set(ids))
        assert set(re.findall(r'(?:href="|url\()#([^")]+)', page)) <= set(ids)

    def test_same_data_same_bytes(self, page: str) -> None:
        assert report_html(data_of()) == page

    def test_is_small(self, page: str) -> None:
        assert len(page.encode()) < 300_000

    def test_says_where_the_lamp_is_and_what_the_bars_are(self, page: str) -> None:
        text = words(page)
        for phrase in ("lamp’s side", "mirror side", "lamp 30°", "(k = 1)", "L(θᵣ) / L(0)", "1/sr"):
            assert phrase in text

    def test_chosen_model_comes_first_with_its_values(self, page: str) -> None:
        assert page.index("oren_nayar", page.index("<tbody>")) < page.index("<tr><td>lambert")
        assert page.count("20.013 ± 0.021\u00a0°") == 2  # in the verdict and in the table
        assert "not determined, in [0, 0.123]" in page
        assert ">692.0<" in page

    def test_fewest_sections_of_an_empty_report(self) -> None:
        none = np.array([])
        data = ReportData("t", "", "", (), "", (), *(none,) * 7, (), np.array([], dtype=bool))
        page = report_html(data)
        assert "No model was fitted." in page
        assert "<svg" not in page


def test_hostile_texts_stay_texts() -> None:
    parameter = Parameter(HOSTILE, 1.0, 0.1, None, HOSTILE)
    model = Candidate(HOSTILE, (parameter,), 0.1, 1.0, 1.0, True, True, HOSTILE, curve=flat)
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
    assert "<script" not in page
    assert "\x00" not in page
    assert page.count("&lt;script&gt;alert(&#x27;1&#x27;)") > 25
    assert len(svgs(page)) == 5


class TestFile:
    def test_is_written_whole_and_alone(self, tmp_path: Path) -> None:
        path = tmp_path / "report.html"
        path.write_text("old")
        write_report(path, data_of(sample="caf\udce9"))  # a file name that was not UTF-8
        assert path.read_text(encoding="utf-8").endswith("</html>\n")
        assert list(tmp_path.iterdir()) == [path]

    def test_old_one_survives(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        path = tmp_path / "report.html"
        path.write_text("old")

        def full(self: Path, _: Path) -> None:
            raise OSError(errno.ENOSPC, "no space left on device")

        monkeypatch.setattr(Path, "replace", full)
        with pytest.raises(StorageError, match=r"report\.html: the disk is full"):
            write_report(path, without_tile())
        assert path.read_text() == "old"
        assert list(tmp_path.iterdir()) == [path]


class TestFormatValue:
    @pytest.mark.parametrize(
        ("value", "u", "unit", "expected"),
        [
            (20.01311, 0.0213, "°", "20.013 ± 0.021\u00a0°"),
            (20.01311, 0.0996, "", "20.01 ± 0.10"),  # rounding up makes a digit more
            (0.9, 0.25, "", "0.90 ± 0.25"),
            (12346.0, 123.0, "mm", "12350 ± 120\u00a0mm"),
            (-1.0, 3.0, "", "-1.0 ± 3.0"),
            (1.2346e-9, 2.1e-11, "", "(1.235 ± 0.021)\u00a0×\u00a010⁻⁹"),
            (4.2e9, 1.0e8, "", "(4.20 ± 0.10)\u00a0×\u00a010⁹"),
            (0.0, 1.0e-9, "", "(0.0 ± 1.0)\u00a0×\u00a010⁻⁹"),
            (20.01311, None, "°", "20.01\u00a0°"),
            (20.01311, 0.0, "", "20.01"),
            (20.01311, NAN, "", "20.01"),
            (20.01311, np.inf, "", "20.01"),
            (NAN, 0.1, "°", "—"),
            (np.inf, None, "", "—"),
        ],
    )
    def test_two_digits_of_the_uncertainty(
        self, value: float, u: float | None, unit: str, expected: str
    ) -> None:
        assert format_value(value, u, unit) == expected


class TestNoTile:
    def test_shows_radiance_and_says_that_it_is_relative(self) -> None:
        page = report_html(without_tile())
        assert "radiance is relative" in page
        assert "radiance (counts/s)" in page
        assert "BRDF (1/sr)" not in page
        assert 'id="candidates"' not in page

    def test_a_line_is_scaled_to_the_points(self) -> None:
        model = replace(data_of().candidates[1], residuals=None)
        sweep = sweeps_of(replace(without_tile(), candidates=(model,)))[0]
        line = np.interp(sweep.theta_r_deg, sweep.line_deg, sweep.lines[0])
        np.testing.assert_allclose(line, sweep.value, rtol=1e-12)  # the same shape, so the same


class TestBrokenNumbers:
    @pytest.mark.parametrize("where", ["brdf", "u_brdf", "theta_r_deg", "theta_i_deg", "dphi_deg"])
    def test_bad_numbers_spoil_no_other(self, where: str) -> None:
        data = data_of((30.0,))
        column = getattr(data, where).copy()
        column[1:6] = NAN, np.inf, -np.inf, 0.0, -1.0
        changes: dict[str, Any] = {where: column}
        page = report_html(replace(data, **changes))
        assert len(svgs(page)) == 6
        assert "nan" not in words(page).lower()

    def test_no_number_is_good(self) -> None:
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
        assert len(svgs(report_html(whole))) == 6
        page = report_html(replace(whole, **columns))
        assert "No geometry gave a value to draw." in page

    def test_all_flagged_and_all_zero(self) -> None:
        data = data_of(theta_r=(0.0,))
        nothing, no = np.zeros(2), np.zeros(2, dtype=bool)
        data = replace(data, brdf=nothing, flags=("dark", "dark"), fitted=no, candidates=())
        assert "Flagged points" in report_html(data)


class TestSweeps:
    def test_two_forms_of_a_direction_are_one_sweep(self) -> None:
        # A negative theta_r with dphi, and a positive one with dphi + 180: geometry.py.
        signed = sweeps_of(data_of((30.0,), (0.0,), (-30.0, 0.0, 30.0)))
        data = data_of((30.0,), (0.0,), (-30.0, 0.0, 30.0))
        folded = replace(
            data, theta_r_deg=np.abs(data.theta_r_deg), dphi_deg=np.array([180.0, 0.0, 360.0])
        )
        (sweep,) = sweeps_of(folded)
        np.testing.assert_array_equal(sweep.theta_r_deg, signed[0].theta_r_deg)
        np.testing.assert_array_equal(sweep.value, signed[0].value)
        assert sweep.in_plane

    @pytest.mark.parametrize(
        ("dphi_deg", "plane_deg", "sign"),
        [
            (45.0, 45.0, 1),
            (90.0, 90.0, 1),
            (135.0, 315.0, -1),
            (270.0, 90.0, -1),
            (315.0, 315.0, 1),
        ],
    )
    def test_positive_is_the_lamps_side_in_every_plane(
        self, dphi_deg: float, plane_deg: float, sign: int
    ) -> None:
        (sweep,) = sweeps_of(data_of((30.0,), (dphi_deg,), (-20.0, 40.0)))
        assert sweep.plane_deg == plane_deg
        np.testing.assert_array_equal(sweep.theta_r_deg, np.sort(sign * np.array([-20.0, 40.0])))

    def test_angles_as_read_back_fall_into_their_settings(self) -> None:
        data = data_of((30.0, 60.0), (0.0, 45.0))
        jitter = np.random.default_rng(1).uniform(-0.05, 0.05, (2, len(data.flags)))
        data = replace(
            data, theta_i_deg=data.theta_i_deg + jitter[0], dphi_deg=data.dphi_deg + jitter[1]
        )
        sweeps = sweeps_of(data)
        assert [(s.plane, s.incidence) for s in sweeps] == [(0, 0), (0, 1), (1, 0), (1, 1)]

    def test_normal_value_is_measured_between_neighbours(self) -> None:
        data = data_of((30.0,), theta_r=(-10.0, 10.0, 30.0))
        assert sweeps_of(data)[0].at_normal == pytest.approx(0.25)

    def test_normal_value_comes_from_the_model_where_none_is_measured(self) -> None:
        data = data_of((30.0,), theta_r=(20.0, 40.0))
        assert sweeps_of(data)[0].at_normal == pytest.approx(0.25)
        bare = replace(data, candidates=())
        assert np.isnan(sweeps_of(bare)[0].at_normal)
        assert svgs(report_html(bare))

    def test_residuals_belong_to_the_points_of_the_fit(self) -> None:
        data = data_of((30.0,), theta_r=(-30.0, 0.0, 30.0))
        fitted = np.array([True, False, True])
        model = replace(data.candidates[1], residuals=np.array([1.0, -2.0]))
        (sweep,) = sweeps_of(replace(data, fitted=fitted, candidates=(model,)))
        np.testing.assert_array_equal(sweep.residual, [1.0, np.nan, -2.0])

    def test_many_sweeps_are_thinned_and_said_so(self) -> None:
        incidences = tuple(np.arange(0.0, 70.0, 5.0))
        page = report_html(data_of(incidences, theta_r=(-30.0, 30.0)))
        assert "12 of 14 sweeps are shown" in page


def test_flagged_points_are_listed_and_crossed() -> None:
    data = data_of((30.0,), theta_r=(-30.0, 0.0, 30.0))
    flags = ("", "", "saturated: 3 pixels")
    fitted = np.array([True, True, False])
    model = replace(data.candidates[1], residuals=np.zeros(2))
    page = report_html(replace(data, flags=flags, fitted=fitted, candidates=(model,)))
    assert "saturated: 3 pixels" in page
    assert "<b>1 flagged</b>" in page
    assert "Crossed dots are flagged." in page


def test_several_planes_are_named() -> None:
    page = report_html(data_of((30.0,), (0.0, 45.0, 90.0), (-30.0, 0.0, 30.0)))
    text = words(page)
    for plane in ("Δφ = 0° (negative θᵣ: Δφ = 180°)", "Δφ = 45° (negative θᵣ: Δφ = 225°)"):
        assert plane in text


def test_window_is_drawn_about_the_centres_of_its_pixels(page: str) -> None:
    picture = next(s for s in svgs(page) if s.find("image") is not None)
    outline = picture.find("polygon")
    assert picture.get("viewBox") == "0 0 4 3"
    assert outline is not None
    assert outline.get("points") == "0.50,0.50 3.50,0.50 3.50,2.50"


@pytest.mark.parametrize("column", ["brdf", "flags", "fitted", "theta_r_deg"])
def test_columns_of_unlike_lengths_are_refused(column: str) -> None:
    data = data_of()
    with pytest.raises(ValueError, match=r"entries for \d+ points"):
        replace(data, **{column: getattr(data, column)[1:]})


def test_residuals_of_another_fit_are_refused() -> None:
    data = data_of()
    with pytest.raises(ValueError, match="17 residuals for 18 points"):
        replace(data, candidates=(replace(data.candidates[1], residuals=np.zeros(17)),))
