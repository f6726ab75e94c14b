"""Mistakes in protocols and rigs: the text to replace, its replacement, and the whole message.

Lines and columns are counted by hand in `texts.PROTOCOL` and `texts.RIG`.
"""

from tests.support.config.texts import PROTOCOL

STEPS_OR_LIST = "a list of numbers from -360 to 360 or a block with start, stop, num, step"

PROTOCOL_MISTAKES = {
    "number for text": (
        "name: foam\n",
        "name: 5\n",
        "1:7: name: 5 is a number; allowed: text of 1 to 200 characters (write '5', in quotes)",
    ),
    "empty text": (
        "name: foam\n",
        "name: ''\n",
        "1:7: name: '' is empty; allowed: text of 1 to 200 characters",
    ),
    "text for a number": (
        "{width_mm: 20.0",
        "{width_mm: wide",
        "8:20: window.width_mm: 'wide' is text; allowed: a number, greater than 0",
    ),
    "quoted number": (
        "{width_mm: 20.0",
        "{width_mm: '20'",
        "8:20: window.width_mm: '20' is text; allowed: a number, greater than 0"
        " (write 20, without quotes)",
    ),
    "exponent without a point": (
        "0.7",
        "5e-3",
        "10:18: exposure_target: '5e-3' is text by the rules of YAML; allowed: a number,"
        " greater than 0 and less than 1 (write 5.0e-3)",
    ),
    "base sixty": (
        "0.7",
        "1:30",
        "10:18: exposure_target: '1:30' is text by the rules of YAML; allowed: a number,"
        " greater than 0 and less than 1"
        " (write one number, in the unit that the key names, without a colon)",
    ),
    "underscore": (
        "point: 4",
        "point: 1_000",
        "9:19: frames_per_point: '1_000' is text by the rules of YAML; allowed: a whole number"
        " from 1 to 10000 (write 1000)",
    ),
    "octal": (
        "point: 4",
        "point: 010",
        "9:19: frames_per_point: '010' is text by the rules of YAML; allowed: a whole number"
        " from 1 to 10000 (write 10)",
    ),
    "not whole": (
        "point: 4",
        "point: 4.5",
        "9:19: frames_per_point: 4.5 is not a whole number; allowed: a whole number"
        " from 1 to 10000",
    ),
    "whole with a point": (
        "point: 4",
        "point: 4.0",
        "9:19: frames_per_point: 4.0 is not a whole number; allowed: a whole number"
        " from 1 to 10000 (write 4)",
    ),
    "truth for a number": (
        "0.7",
        "true",
        "10:18: exposure_target: true is a true/false value; allowed: a number,"
        " greater than 0 and less than 1",
    ),
    "truth for a whole number": (
        "point: 4",
        "point: true",
        "9:19: frames_per_point: true is a true/false value; allowed: a whole number"
        " from 1 to 10000",
    ),
    "too large": (
        "0.99",
        "1.5",
        "12:29: references.white_tile.reflectance: 1.5; allowed: at most 1 (0/45 or 45/0: 2)",
    ),
    "too small": (
        "width_mm: 50.0",
        "width_mm: -1",
        "3:32: sample.width_mm: -1 is too small; allowed: a number, greater than 0 and at most 500",
    ),
    "not finite": (
        "albedo: 0.8",
        "albedo: .inf",
        "18:24: simulated_sample.parameters.albedo: inf is not finite; allowed: a number",
    ),
    "nothing where a block is wanted": (
        "window: {width_mm: 20.0, height_mm: 20.0}",
        "window:",
        "8:8: window: nothing is given; allowed: a block with width_mm, height_mm, min_pixels",
    ),
    "text for a list": (
        "[lambert, oren_nayar]",
        "lambert",
        "15:11: fit.models: 'lambert' is text; allowed: a list of texts of 1 to 200 characters"
        " (write ['lambert'])",
    ),
    "missing key": (
        ", u_reflectance: 0.005",
        "",
        "12:15: references.white_tile.u_reflectance: is missing; allowed: a number, or a table",
    ),
    "missing section": (
        "window: {width_mm: 20.0, height_mm: 20.0}\n",
        "",
        "1:1: window: is missing; allowed: a block with width_mm, height_mm, min_pixels",
    ),
    "unknown key": (
        "point: 4",
        "point: 4\ncolour: red",
        "10:1: colour: unknown key; allowed: name, description, rig, sample, sweeps, window,"
        " markers, polariser_deg, frames_per_point, dark_frames, exposure_target, keep_frames,"
        " maps, motion, fly, references, fit, simulated_sample, metadata, goal, budget_min",
    ),
    "misspelt key that is required": (
        "u_reflectance: 0.005",
        "u_reflectence: 0.005",
        "12:35: references.white_tile.u_reflectence: unknown key; did you mean u_reflectance?"
        " allowed: reflectance, u_reflectance, table, certificate, theta_r_deg, frames, width_mm,"
        " height_mm, again_at_end",
    ),
    "double key": (
        "exposure_target: 0.7",
        "frames_per_point: 5",
        "10:1: frames_per_point: duplicate key, first at line 9, column 1; keep one of them",
    ),
    "one angle without brackets": (
        "dphi_deg: [0.0]",
        "dphi_deg: 0.0",
        f"6:15: sweeps[0].dphi_deg: 0.0 is a number; allowed: {STEPS_OR_LIST} (write [0.0])",
    ),
    "text for angles": (
        "dphi_deg: [0.0]",
        "dphi_deg: all",
        f"6:15: sweeps[0].dphi_deg: 'all' is text; allowed: {STEPS_OR_LIST}",
    ),
    "nothing for angles": (
        "dphi_deg: [0.0]",
        "dphi_deg:",
        f"6:14: sweeps[0].dphi_deg: nothing is given; allowed: {STEPS_OR_LIST}",
    ),
    "text among angles": (
        "[30, 45.0, 60.0]",
        "[30, x, 60.0]",
        "5:23: sweeps[0].theta_i_deg[1]: 'x' is text; allowed: a number from -360 to 360",
    ),
    "no angle": (
        "dphi_deg: [0.0]",
        "dphi_deg: []",
        "6:15: sweeps[0].dphi_deg: a list of 0 is too short; allowed: "
        "a list of numbers from -360 to 360 or a block with start, stop, num, step",
    ),
    "num 0": (
        "num: 33",
        "num: 0",
        "7:50: sweeps[0].theta_r_deg.num: 0 is too small; allowed: a whole number from 1 to 100000",
    ),
    "num 1 for two angles": (
        "num: 33",
        "num: 1",
        "7:50: sweeps[0].theta_r_deg.num: 1; allowed: 2 or more from -80 to 80",
    ),
    "num missing": (
        ", num: 33",
        "",
        "7:18: sweeps[0].theta_r_deg.num: is missing; allowed: a whole number from 1 to 100000, or"
        " `step`",
    ),
    "step beside num": (
        "num: 33",
        "num: 33, step: 5",
        "7:60: sweeps[0].theta_r_deg.step: 5 beside num 33; allowed: one of the two",
    ),
    "step past the end": (
        "num: 33",
        "step: 7",
        "7:51: sweeps[0].theta_r_deg.step: 7 does not lead from -80 to 80; allowed: a part of"
        " their distance of 160, such as 6.95652 or num: 24",
    ),
    "axis missing": (
        "    dphi_deg: [0.0]\n",
        "",
        f"5:5: sweeps[0].dphi_deg: is missing; allowed: {STEPS_OR_LIST}",
    ),
    "axis misspelt": (
        "dphi_deg: [0.0]",
        "phi_deg: [0.0]",
        "6:5: sweeps[0].phi_deg: unknown key; did you mean dphi_deg?"
        " allowed: theta_i_deg, dphi_deg, theta_r_deg",
    ),
    "axis unknown": (
        "dphi_deg: [0.0]",
        "dphi_deg: [0.0]\n    chi: [1]",
        "7:5: sweeps[0].chi: unknown key; allowed: theta_i_deg, dphi_deg, theta_r_deg",
    ),
    "empty sweep": (
        "num: 33}\n",
        "num: 33}\n  - {}\n",
        "8:5: sweeps[1]: an empty sweep; allowed: a block with theta_i_deg, dphi_deg, theta_r_deg",
    ),
    "tile past the geometry": (
        "0.005, theta_r_deg: 10.0",
        "0.005, theta_r_deg: 95.0",
        "12:70: references.white_tile.theta_r_deg: 95.0 is too large; allowed: a number"
        " from -89.5 to 89.5",
    ),
    "rig not there": (
        "rig: rig.yaml",
        "rig: rigg.yaml",
        "2:6: rig: rigg.yaml: no such file; in . there is rig.yaml",
    ),
    "rig with a name that no system takes": (
        "rig: rig.yaml",
        'rig: "a\\0b"',
        "2:6: rig: 'a\\x00b' holds a control character (\\x00); remove it",
    ),
    "keys called like forms": (
        "sigma_deg: 20",
        "steps: x",
        "18:36: simulated_sample.parameters.steps: 'x' is text; allowed: a number",
    ),
}

# Across values of a protocol, and against its rig.
CHECK_MISTAKES = {
    "incidence past the geometry": (
        "60.0]",
        "95.0]",
        "5:29: sweeps[0].theta_i_deg[2]: 95 deg; allowed: 0 to 89.5 deg from the normal",
    ),
    "incidence past the axis": (
        "60.0]",
        "85.0]",
        "5:29: sweeps[0].theta_i_deg[2]: 85 deg is past the limits of axis theta_i;"
        " allowed: 0 to 80 deg (rig.yaml:7)",
    ),
    "view past the geometry": (
        "start: -80.0",
        "start: -91",
        "7:26: sweeps[0].theta_r_deg.start: -91 deg; allowed: -89.5 to 89.5 deg from the normal",
    ),
    "view past the axis": (
        "stop: 80.0",
        "stop: 88.5",
        "7:39: sweeps[0].theta_r_deg.stop: 88.5 deg is past the limits of axis theta_r;"
        " allowed: -88 to 88 deg (rig.yaml:10)",
    ),
    "azimuth past the axis": (
        "dphi_deg: [0.0]",
        "dphi_deg: [0.0, 190]",
        "6:21: sweeps[0].dphi_deg[1]: 190 deg is past the limits of axis dphi;"
        " allowed: 0 to 180 deg (rig.yaml:8)",
    ),
    "tile past the axis": (
        "0.005, theta_r_deg: 10.0",
        "0.005, theta_r_deg: 89.0",
        "12:70: references.white_tile.theta_r_deg: 89 deg is past the limits of axis theta_r;"
        " allowed: -88 to 88 deg (rig.yaml:10)",
    ),
    "drift check past the axis": (
        "{theta_r_deg: 10.0, every",
        "{theta_r_deg: -89.0, every",
        "13:30: references.drift_check.theta_r_deg: -89 deg is past the limits of axis theta_r;"
        " allowed: -88 to 88 deg (rig.yaml:10)",
    ),
    "window past the sample": (
        "{width_mm: 20.0",
        "{width_mm: 60.0",
        "8:20: window.width_mm: 60 mm is larger than the sample; allowed: at most 50 mm",
    ),
    "window past the picture": (
        "height_mm: 20.0}",
        "height_mm: 40.0}",
        "8:37: window.height_mm: 40 mm is larger than the camera's field; allowed: at most 36 mm"
        " (rig.yaml:23)",
    ),
    "angle twice": (
        "60.0]",
        "30.0]",
        "5:29: sweeps[0].theta_i_deg[2]: 30 deg is already in [0] of this list; allowed: each once",
    ),
    "sweep partly twice": (
        "num: 33}\n",
        "num: 33}\n  - theta_i_deg: [60, 70]\n    dphi_deg: [0, 5]\n    theta_r_deg: [0, 1, 5]\n",
        "8:5: sweeps[1]: 2 of its geometries are already in sweeps[0], such as"
        " theta_i 60, dphi 0, theta_r 0 deg; allowed: each once",
    ),
    "too many": (
        "{start: -80.0, stop: 80.0, num: 33}",
        "{start: -80.0, stop: 80.0, num: 100000}\n  - theta_i_deg: {start: 0, stop: 1, num: 9}\n"
        "    dphi_deg: [0]\n    theta_r_deg: {start: -80.0, stop: 80.0, num: 100000}",
        "5:3: sweeps: 1200000 geometries; allowed: at most 1000000 in a protocol",
    ),
    "unknown model": (
        "[lambert, oren_nayar]",
        "[lambert, oren_nayer]",
        "15:21: fit.models[1]: 'oren_nayer' is no model; allowed: lambert, oren_nayar",
    ),
    "unknown simulated model": (
        "model: oren_nayar",
        "model: phong",
        "17:10: simulated_sample.model: 'phong' is no model; allowed: lambert, oren_nayar",
    ),
    "unknown parameter of the simulated model": (
        "sigma_deg: 20",
        "gloss: 20",
        "18:15: simulated_sample.parameters: oren_nayar has no parameter gloss",
    ),
    "simulated rig without a sample": (
        PROTOCOL[PROTOCOL.index("simulated_sample") :],
        "",
        "1:1: simulated_sample: is missing; the rig rig.yaml is simulated and needs a sample to"
        " render",
    ),
}

DRIVERS = "hand or newport or ophyd or oriental or simulated or zaber"

RIG_MISTAKES = {
    "driver missing": (
        "dphi: {driver: hand, ",
        "dphi: {",
        "8:9: axes.dphi.driver: is missing; allowed: " + DRIVERS,
    ),
    "driver unknown": (
        "dphi: {driver: hand",
        "dphi: {driver: hands",
        "8:18: axes.dphi.driver: 'hands' is none of these; allowed: "
        + DRIVERS
        + " (did you mean hand?)",
    ),
    "no axis": (
        "dphi: {driver: hand, min_deg: 0.0, max_deg: 180.0, u_deg: 0.1}",
        "dphi: 4",
        "8:9: axes.dphi: 4 is a number; allowed: a block with driver: " + DRIVERS,
    ),
    "key of another driver": (
        "max_deg: 180.0",
        "settle_s: 1.0, max_deg: 180.0",
        "8:38: axes.dphi.settle_s: unknown key; did you mean set_s? allowed: min_deg, max_deg,"
        " zero_deg, sign, u_deg, driver, set_s",
    ),
    "key called like the driver": (
        "max_deg: 180.0",
        "hand: 1.0, max_deg: 180.0",
        "8:38: axes.dphi.hand: unknown key; allowed: min_deg, max_deg,"
        " zero_deg, sign, u_deg, driver, set_s",
    ),
    "sign": (
        "max_deg: 180.0",
        "sign: 2, max_deg: 180.0",
        "8:44: axes.dphi.sign: 2 is none of these; allowed: 1 or -1",
    ),
    "limits swapped": (
        "max_deg: 180.0",
        "max_deg: -5",
        "8:33: axes.dphi.min_deg: 0; allowed: less than max_deg -5",
    ),
    "range of one": (
        "[-90.0, -87.0]",
        "[-90.0]",
        "18:31: keep_out[0].theta_r_deg: a list of 1 is too short; allowed: a list of 2 numbers",
    ),
    "range swapped": (
        "[-90.0, -87.0]",
        "[-87.0, -90.0]",
        "18:31: keep_out[0].theta_r_deg: [-87, -90]; allowed: [low, high]",
    ),
    "box and cone": (
        "[-90.0, -87.0]",
        "[-90.0, -87.0], camera_to_lamp_deg: 4",
        "18:12: keep_out[0].name: 'post' is both a box and a cone; allowed: either some of"
        " theta_i_deg, dphi_deg, theta_r_deg, or camera_to_lamp_deg",
    ),
    "exposures swapped": (
        "max_exposure_s: 2.0",
        "max_exposure_s: 1.0e-4",
        "31:19: camera.min_exposure_s: 0.0005; allowed: at most max_exposure_s 0.0001",
    ),
    "axis outside the picture": (
        "axis_row_px: 160.0",
        "axis_row_px: 320",
        "24:16: camera.axis_row_px: 320 is outside the image; allowed: 0 to 319",
    ),
    "list for a block": (
        "lamp: {driver: simulated, darkened_by: shutter, white_electrons_per_s: 600000.0}",
        "lamp: [1]",
        "34:7: lamp: a list is given; allowed: a block with driver, darkened_by, shutter_s,"
        " cover_s, white_electrons_per_s, u_flicker",
    ),
}
