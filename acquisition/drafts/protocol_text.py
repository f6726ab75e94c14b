"""Text of a protocol made of answers; each line says in a comment what it is."""

from __future__ import annotations

from collections.abc import Iterator

from acquisition.drafts.protocol_questions import NONE, Scan
from acquisition.drafts.question import Answers
from acquisition.drafts.yaml_words import commented, flow, line, yaml_value

_USUAL_MODEL = "oren_nayar"


def protocol_text(scan: Scan, answers: Answers) -> str:
    """Return the whole file."""
    return "\n".join(_lines(scan, answers)) + "\n"


def _lines(scan: Scan, answers: Answers) -> Iterator[str]:
    yield "# A scan, as answered in `gonio new protocol`. Every key has its unit in its name."
    yield line("name", answers["name"], "in reports and in the folder of a run")
    yield line("rig", scan.rig_name, "from the folder of this file")
    yield ""
    yield from _sample(answers)
    yield ""
    yield from _sweep(answers)
    yield ""
    window = [(f"{k}_mm", answers[f"window_{k}_mm"]) for k in ("width", "height")]
    yield commented(f"window: {flow(window)}", "the patch of the sample that counts")
    yield line("frames_per_point", answers["frames_per_point"], "averaged at each geometry")
    yield line("exposure_target", 0.7, "of full scale, for the brightest part of the window")
    yield ""
    yield from _references(answers)
    yield from _simulated_sample(scan, answers)


def _sample(answers: Answers) -> Iterator[str]:
    yield "sample:"
    yield line("name", answers["sample_name"], "", 2)
    yield line("width_mm", answers["sample_width_mm"], "", 2)
    yield line("height_mm", answers["sample_height_mm"], "", 2)
    what = "rectangle: its edges in the picture are compared with the pose"
    yield line("outline", answers["sample_outline"], what, 2)


def _sweep(answers: Answers) -> Iterator[str]:
    start, stop, num = (answers[f"theta_r_{key}"] for key in ("start_deg", "stop_deg", "num"))
    steps = flow([("start", start), ("stop", stop), ("num", num)])
    yield commented("sweeps:", "slowest axis first; axes set by hand always come first")
    lamp = f"  - theta_i_deg: {yaml_value(answers['theta_i_deg'])}"
    yield commented(lamp, "of the lamp, from the normal")
    yield line("dphi_deg", answers["dphi_deg"], "0 is the lamp's own side, 180 the mirror side", 4)
    yield commented(f"    theta_r_deg: {steps}", "of the camera")


def _references(answers: Answers) -> Iterator[str]:
    tile, drift = (answers[key] != NONE for key in ("white_tile", "drift_check"))
    if not tile:
        yield "# Without `references: white_tile` the radiance stays relative (docs/protocols.md)."
    if not tile and not drift:
        return
    yield "references:"
    view = answers["reference_theta_r_deg"]
    if tile:
        yield "  white_tile:"
        yield line("reflectance", answers["reflectance"], "from its certificate", 4)
        yield line("u_reflectance", answers["u_reflectance"], "k = 1, absolute", 4)
        yield line("certificate", answers["certificate"], "geometry of that number", 4)
        yield line("theta_r_deg", view, "view angle at which it is read", 4)
    if drift:
        check = flow([("theta_r_deg", view), ("every_points", answers["drift_every_points"])])
        yield commented(f"  drift_check: {check}", "follows the lamp")


def _simulated_sample(scan: Scan, answers: Answers) -> Iterator[str]:
    model = str(answers.get("model", _USUAL_MODEL))
    yield ""
    yield commented("simulated_sample:", "real rigs ignore this; the fit never sees it")
    yield line("model", model, "", 2)
    parameters = list(scan.models[model].items())
    yield commented(f"  parameters: {flow(parameters)}", "the model's usual ones")
