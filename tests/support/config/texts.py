"""A small valid protocol and rig as texts, and loading of changed ones in the current folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from instrument.config.load import Loaded, load_protocol
from instrument.errors import InputError

RIG = """\
name: small
beam_length_mm: 800.0
lamp_distance_mm: 1000
source_solid_angle_sr: 0.0005
receiver_solid_angle_sr: 0.0003
axes:
  theta_i: {driver: hand, min_deg: 0.0, max_deg: 80.0, u_deg: 0.1}
  dphi: {driver: hand, min_deg: 0.0, max_deg: 180.0, u_deg: 0.1}
  theta_r:
    driver: simulated
    min_deg: -88.0
    max_deg: 88.0
    speed_deg_per_s: 20.0
    acceleration_deg_per_s2: 40.0
    settle_s: 0.3
    u_deg: 0.02
keep_out:
  - {name: post, theta_r_deg: [-90.0, -87.0]}
camera:
  driver: simulated
  width_px: 640
  height_px: 320
  field_width_mm: 72.0
  axis_row_px: 160.0
  axis_column_px: 320.0
  bit_depth: 12
  full_well_electrons: 30000.0
  read_noise_electrons: 8.0
  dark_current_electrons_per_s: 20.0
  black_level_dn: 64.0
  min_exposure_s: 0.0005
  max_exposure_s: 2.0
  frame_overhead_s: 0.02
lamp: {driver: simulated, darkened_by: shutter, white_electrons_per_s: 600000.0}
"""

PROTOCOL = """\
name: foam
rig: rig.yaml
sample: {name: foam, width_mm: 50.0, height_mm: 50.0}
sweeps:
  - theta_i_deg: [30, 45.0, 60.0]
    dphi_deg: [0.0]
    theta_r_deg: {start: -80.0, stop: 80.0, num: 33}
window: {width_mm: 20.0, height_mm: 20.0}
frames_per_point: 4
exposure_target: 0.7
references:
  white_tile: {reflectance: 0.99, u_reflectance: 0.005, theta_r_deg: 10.0}
  drift_check: {theta_r_deg: 10.0, every_points: 25}
fit:
  models: [lambert, oren_nayar]
simulated_sample:
  model: oren_nayar
  parameters: {albedo: 0.8, sigma_deg: 20}
"""


def check_model(name: str, parameters: dict[str, float] | None) -> str | None:
    if name not in ("lambert", "oren_nayar"):
        return f"{name!r} is no model; allowed: lambert, oren_nayar"
    wrong = set(parameters or {}) - {"albedo", "sigma_deg"}
    return f"{name} has no parameter {wrong.pop()}" if wrong else None


def load(protocol: str = PROTOCOL, rig: str = RIG) -> Loaded:
    Path("protocol.yaml").write_text(protocol)
    Path("rig.yaml").write_text(rig)
    return load_protocol(Path("protocol.yaml"), check_model=check_model)


def problems(protocol: str = PROTOCOL, rig: str = RIG) -> tuple[str, ...]:
    with pytest.raises(InputError) as caught:
        load(protocol, rig)
    return caught.value.problems


def changed(text: str, old: str, new: str) -> str:
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times"
    return text.replace(old, new)
