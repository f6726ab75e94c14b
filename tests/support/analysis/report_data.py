"""Data of small reports, and readers of the pages made from them."""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import numpy as np

from analysis.report.data import Candidate, Parameter, ReportData
from instrument.geometry import FloatArray
from instrument.record.reading import Preview

NAN = float("nan")


def tilted(theta_i_deg: FloatArray, dphi_deg: FloatArray, theta_r_deg: FloatArray) -> FloatArray:
    """BRDF that rises towards the lamp's side, as of a rough matte surface."""
    towards = np.sin(np.radians(theta_r_deg)) * np.cos(np.radians(dphi_deg))
    return np.asarray(0.25 + 0.1 * np.sin(np.radians(theta_i_deg)) * towards)


def flat(theta_i_deg: FloatArray, dphi_deg: FloatArray, theta_r_deg: FloatArray) -> FloatArray:
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


POOR = Candidate(
    name="lambert",
    parameters=(Parameter("ks", 0.01, None, (0.0, 0.123), ""),),
    rms_relative=0.1,
    reduced_chi2=96.4,
    bic=-120.0,
    converged=True,
    chosen=False,
    curve=flat,
)


def good_candidate(points: int) -> Candidate:
    """The chosen candidate, with a residual for each of the points."""
    return Candidate(
        name="oren_nayar",
        parameters=(
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


def data_of(
    incidences: tuple[float, ...] = (30.0, 60.0),
    dphis: tuple[float, ...] = (0.0,),
    theta_r: tuple[float, ...] = tuple(range(-60, 61, 15)),
    **changes: Any,
) -> ReportData:
    rows = [(i, d, r) for d in dphis for i in incidences for r in theta_r]
    theta_i_deg, dphi_deg, theta_r_deg = np.array(rows, dtype=np.float64).T
    brdf = tilted(theta_i_deg, dphi_deg, theta_r_deg)
    points = len(rows)
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
        candidates=(POOR, good_candidate(points)),
        budget=(("photon noise", 0.17, 62.0), ("white tile", NAN, NAN)),
        previews=(Preview(0, "at 30°", png(), [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0]]),),
        rig=(("lamp", "halogen"),),
        devices=(("stage", "serial 7"),),
        versions=(("gonio", "0.1.0"),),
        times=(("started", "2025-11-21 23:10 UTC"),),
    )
    return replace(data, **changes)


def without_tile(data: ReportData | None = None) -> ReportData:
    data = data_of() if data is None else data
    none = np.full(len(data.flags), NAN)
    nothing = np.zeros(len(data.flags), dtype=bool)
    return replace(data, brdf=none, u_brdf=none, fitted=nothing, candidates=(), verdict_kind="")


def svgs(page: str) -> list[ElementTree.Element]:
    found = re.findall(r"<svg\b.*?</svg>", page, flags=re.DOTALL)
    return [ElementTree.fromstring(text) for text in found]  # our own text


def words(page: str) -> str:
    return " ".join(re.sub(r"<style>.*?</style>|<[^>]+>", " ", page, flags=re.DOTALL).split())
