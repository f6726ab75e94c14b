"""Content of a run's report, gathered from its record, reduction and fit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from acquisition.results.facts.chosen_geometries import reasons
from acquisition.results.facts.input_files import calibration_rows, file_rows
from acquisition.results.facts.lamp_levels import lamp_levels
from acquisition.results.facts.rendered_material import camera_noise, rendered_material
from acquisition.results.fitting import Fitted
from acquisition.results.reduction import Reduced
from acquisition.results.summary import budget, parameters_of, sources_of
from acquisition.results.versions import LIBRARIES, versions_of
from analysis.choice.choice import Choice
from analysis.fit.fit import FitResult
from analysis.report.data import Candidate, Curve, ReportData
from instrument.config.axes import AXES
from instrument.config.load import Loaded
from instrument.config.protocol import Metadata, WhiteTile
from instrument.config.rig import Rig
from instrument.geometry import FloatArray, Geometry
from instrument.record.record import Record

Rows = tuple[tuple[str, str], ...]


def report_data(
    reduced: Reduced,
    fitted: Fitted,
    record: Record,
    loaded: Loaded,
    *,
    u_brdf: FloatArray,
    parts: Mapping[str, FloatArray],
    headline: str,
    notes: tuple[str, ...],
) -> ReportData:
    """Return the content of the report; u_brdf (N,) in 1/sr, its parts (N,) and relative."""
    protocol, points = loaded.protocol, reduced.points
    size, patch = protocol.sample, protocol.window
    return ReportData(
        title=protocol.name,
        sample=f"{size.name}, {size.width_mm:g} × {size.height_mm:g} mm; measured on the same "
        f"{patch.width_mm:g} × {patch.height_mm:g} mm of it at every view angle",
        description=protocol.description,
        verdict=(headline,),
        verdict_kind=fitted.choice.verdict if fitted.choice else "",
        notes=notes,
        theta_i_deg=np.array([p.theta_i_deg for p in points]),
        dphi_deg=np.array([p.dphi_deg for p in points]),
        theta_r_deg=np.array([p.theta_r_deg for p in points]),
        brdf=reduced.brdf,
        u_brdf=u_brdf,
        radiance=reduced.radiance,
        u_radiance=reduced.u_radiance,
        flags=reduced.flags,
        fitted=fitted.used if fitted.choice else np.zeros(len(points), dtype=bool),
        candidates=candidates(fitted),
        budget=budget(parts),
        sources=sources_of(parts),
        chosen_for=_chosen_for(reduced, record),
        lamp=lamp_levels(reduced.drifts, record.readings()),
        previews=tuple(record.previews()),
        rendered=rendered_material(fitted.chosen, camera_noise(loaded)),
        rig=(*_rig_rows(loaded.rig), *_tile_rows(protocol.references.white_tile)),
        devices=tuple(record.devices().items()),
        calibrations=calibration_rows(loaded.rig),
        files=file_rows(record),
        metadata=_metadata_rows(protocol.metadata),
        versions=_version_rows(record),
        times=_time_rows(record),
    )


def _chosen_for(reduced: Reduced, record: Record) -> tuple[str, ...]:
    """Return what each point was measured for; nothing for a scan that chose none."""
    own = reasons(record)
    return tuple(own.get(point.step, "not known") for point in reduced.points) if own else ()


def candidates(fitted: Fitted) -> tuple[Candidate, ...]:
    """Return all candidates for the report."""
    return () if fitted.choice is None else candidates_of(fitted.choice)


def candidates_of(choice: Choice) -> tuple[Candidate, ...]:
    """Return the candidates of a choice for the report."""
    return tuple(
        Candidate(
            name=result.model,
            parameters=parameters_of(result),
            rms_relative=result.rms_relative,
            reduced_chi2=result.reduced_chi2,
            bic=result.bic,
            converged=result.converged,
            chosen=result.model == choice.chosen,
            agrees=result.model in choice.agreeing,
            message=result.message,
            residuals=result.residuals,
            curve=_curve(result),
        )
        for result in choice.candidates
    )


def _curve(result: FitResult) -> Curve:
    def curve(theta_i_deg: FloatArray, dphi_deg: FloatArray, theta_r_deg: FloatArray) -> FloatArray:
        geometry = Geometry.from_degrees(theta_i=theta_i_deg, theta_r=theta_r_deg, dphi=dphi_deg)
        return result.brdf(geometry)

    return curve


def _rig_rows(rig: Rig) -> Rows:
    camera = rig.camera
    axes = [(n, f"{rig.axes[n].driver}, u {rig.axes[n].u_deg:g}° (k = 1)") for n in AXES]
    return (
        ("rig", f"{rig.name}: {rig.description}" if rig.description else rig.name),
        ("beam", f"{rig.beam_length_mm:g} mm"),
        ("lamp", f"at {rig.lamp_distance_mm:g} mm, {rig.source_solid_angle_sr:g} sr"),
        ("lens", f"{rig.receiver_solid_angle_sr:g} sr"),
        (
            "camera",
            f"{camera.width_px} × {camera.height_px} pixels, {camera.bit_depth} bit, "
            f"{camera.field_width_mm:g} mm wide at the axis",
        ),
        *axes,
        ("sample on the axis", f"u {rig.u_placement_mm:g} mm (k = 1)"),
    )


def _tile_rows(tile: WhiteTile | None) -> Rows:
    if tile is None:
        return ()
    if tile.values is not None:
        return (("white tile", f"{tile.values.beta.size} radiance factors in {tile.table}"),)
    where = f", certified at {tile.certificate}" if tile.certificate is not None else ""
    return (("white tile", f"{tile.reflectance:g}, u {tile.u_reflectance:g} (k = 1){where}"),)


def _metadata_rows(metadata: Metadata) -> Rows:
    return tuple(
        (name.replace("_nm", " (nm)").replace("_", " "), fact)
        for name, fact in metadata.given().items()
    )


def _version_rows(record: Record) -> Rows:
    scanned = ("gonio, when scanned", record.meta("program_version") or "unknown")
    return (scanned, *versions_of("gonio", *LIBRARIES, "matplotlib").items())


def _time_rows(record: Record) -> Rows:
    labels = {
        "started_utc": "started (UTC)",
        "finished_utc": "finished (UTC)",
        "planned_s": "planned (s)",
        "scan_s": "took (s)",
    }
    values = {key: record.meta(key) or "unknown" for key in labels}
    return tuple((text, _plain_time(values[key])) for key, text in labels.items())


def _plain_time(value: str) -> str:
    """A time in UTC as a person reads it; any other text as it is."""
    return value.replace("T", " ").removesuffix("+00:00") if value.endswith("+00:00") else value
