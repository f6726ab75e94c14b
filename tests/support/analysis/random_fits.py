"""Seeded scans of models drawn at random: model, sweep, truth, noise and shared errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.data.measurements import Measurements, SharedError, setting_numbers
from analysis.models import MODELS, Model
from instrument.geometry import FloatArray, Geometry

LOBES = ("torrance_sparrow", "torrance_sparrow_lobe", "ggx", "beckmann_spizzichino")
SINGLE = (
    *("lambert", "minnaert", "oren_nayar_qualitative", "oren_nayar", "eon", "wolff"),
    *("wolff_oren_nayar", *LOBES, "unified"),
)
SUMS = tuple(f"{body}+{lobe}" for body in ("lambert", "oren_nayar", "wolff") for lobe in LOBES)
SWEEPS = ("whole", "mirror half", "lamp half", "stopped")

# Truths: those of every scale are drawn as a logarithm, as are lengths and the strengths of lobes.
_UNIFORM = {
    "albedo": (0.05, 0.99), "single_scattering_albedo": (0.05, 0.99), "diffuse": (0.05, 0.99),
    "scale": (0.05, 0.99), "sigma_deg": (3.0, 50.0), "lobe_sigma_deg": (3.0, 30.0), "n": (1.2, 2.2),
    "k": (0.5, 1.2), "alpha": (0.05, 0.6), "spike_width_deg": (1.0, 5.0), "roughness": (0.0, 1.0),
}  # fmt: skip
_DECADES = {
    "ks": (-2.0, -0.3), "f0": (-2.0, -0.3), "lobe": (-2.0, -0.3), "spike": (-2.0, -0.3),
    "sigma_h": (-1.3, 0.5), "correlation_length": (0.3, 2.0),
}  # fmt: skip
_FEWEST = 12  # points of a stopped sweep


@dataclass(frozen=True, slots=True)
class Case:
    """A model, its true parameters (K,), and measurements of it."""

    seed: int
    model: Model
    truth: FloatArray
    measurements: Measurements

    def __str__(self) -> str:
        return f"seed {self.seed}: {self.model.name}, {self.measurements.size} points"


def random_case(
    seed: int, names: tuple[str, ...] = SINGLE + SUMS, most_noise: float = 0.01
) -> Case:
    """Scan of 1 to 3 incidences, whole, half or stopped; noise of 3e-5 to 1 %, or to `most_noise`.

    Half of the scans share errors: of a white tile (.5 %), and of the lamp's angle (.02 degrees).
    """
    rng = np.random.default_rng(seed)
    model = MODELS[names[rng.integers(len(names))]]
    theta_i, theta_r = _angles(rng)
    truth = np.array([_value(p.name, rng) for p in model.parameters])
    values = dict(zip((p.name for p in model.parameters), map(float, truth), strict=True))
    noise, shared = 10 ** rng.uniform(*np.log10([3e-5, most_noise])), bool(rng.random() < 0.5)
    u_theta_i, u_tile = (0.02, 0.005) if shared else (0.0, 0.0)
    setting = setting_numbers(theta_i, np.zeros(theta_i.size))
    true_i = np.abs(theta_i + u_theta_i * rng.normal(size=setting.max() + 1)[setting])
    f = model.brdf(Geometry.from_degrees(theta_i=true_i, theta_r=theta_r), **values)
    u = noise * np.abs(f) + 1e-7 * f.max()
    m = Measurements(
        theta_i_deg=theta_i, theta_r_deg=theta_r, dphi_deg=np.zeros(theta_i.size),
        brdf=f * (1 + u_tile * rng.normal()) + u * rng.normal(size=f.size), u_random=u,
        lamp_setting=setting, u_theta_i_deg=u_theta_i,
        shared=(SharedError.common_to_all("white tile", u_tile, f.size),) if shared else (),
    )  # fmt: skip
    return Case(seed, model, truth, m)


def _angles(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """theta_i and theta_r (N,) in degrees, without those where the camera shades the sample."""
    count = int(rng.integers(1, 4))
    incidences = np.sort(rng.choice([0.0, 15.0, 30.0, 45.0, 60.0, 75.0], count, replace=False))
    sweep, step = rng.choice(SWEEPS), rng.choice([2.5, 5.0, 10.0])
    views = np.arange(-80, 80.01, step)
    if "half" in sweep:
        views = views[views <= 0] if sweep == "mirror half" else views[views >= 0]
    theta_i, theta_r = np.repeat(incidences, views.size), np.tile(views, count)
    apart = np.abs(theta_i - theta_r) >= 3
    theta_i, theta_r = theta_i[apart], theta_r[apart]
    if sweep == "stopped":
        read = int(rng.integers(min(_FEWEST, theta_i.size - 1), theta_i.size))
        theta_i, theta_r = theta_i[:read], theta_r[:read]
    return theta_i, theta_r


def _value(name: str, rng: np.random.Generator) -> float:
    if name in _DECADES:
        return float(10 ** rng.uniform(*_DECADES[name]))
    return float(rng.uniform(*_UNIFORM[name]))
