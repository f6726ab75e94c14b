"""Other programs for the same tasks, measured in the same run where they are installed.

lmfit fits the same model and data from the same start. pySCATMECH and Mitsuba evaluate Lambert's
law, which shows the cost of their way of evaluating a BRDF. A program that is missing or does not
work here becomes a line on the page.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import cache, partial
from importlib import metadata
from importlib.util import find_spec
from typing import Any

import numpy as np

from instrument.geometry import Brdf, FloatArray, Geometry

_PACKAGES_AND_TASKS = {
    "lmfit": ("lmfit", "the fit"),
    "pySCATMECH": ("pySCATMECH", "evaluating a BRDF, one geometry a call"),
    "Mitsuba": ("mitsuba", "evaluating a BRDF, many geometries a call"),
}


def peer_lines() -> dict[str, str]:
    """Return the page's line on each other program, by its name."""
    lines = {}
    for name, (package, task) in _PACKAGES_AND_TASKS.items():
        version = _version(package)
        problem = _problem(name) if version else ""
        if version is None:
            text = f": not installed (pip install {package}); {task} not compared"
        else:
            text = f" {version}: "
            text += f"does not work here, not compared: {problem}" if problem else task
        lines[name] = name + text
    return lines


def is_usable(name: str) -> bool:
    """Return True if a program is installed and works."""
    return _version(_PACKAGES_AND_TASKS[name][0]) is not None and not _problem(name)


def _version(package: str) -> str | None:
    if find_spec(package) is None:
        return None
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "of unknown version"


@cache
def _problem(name: str) -> str:
    """Reason why an installed program gives no right answer; empty if it gives one."""
    try:
        found, right = _PROBES[name]()
    except Exception as error:  # noqa: BLE001 - any failure is reported on the page
        return f"{type(error).__name__}: {error}"
    return "" if abs(found - right) < 1e-3 else f"{found:g} instead of {right:g}"


def _probe_lmfit() -> tuple[float, float]:
    low, high = np.zeros(1), np.ones(1)
    found = lmfit_minimum(lambda x: np.array([x[0] - 0.25, 0.0]), np.array([0.5]), low, high)
    return float(found[0]), 0.25


def _probe_lambert(make: Callable[[float], Brdf]) -> tuple[float, float]:
    geometry = Geometry.from_degrees(theta_i=[30.0], theta_r=[50.0], dphi=[70.0])
    return float(make(0.5)(geometry)[0]), 0.5 / np.pi


def lmfit_minimum(
    residual: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:
    """Return the minimum, (parameters,), of lmfit's default method (Levenberg-Marquardt).

    Start, bounds and result are in the units of the parameters; `residual` gives (N,) from them.
    """
    lmfit: Any = importlib.import_module("lmfit")
    parameters = lmfit.Parameters()
    names = [f"x{n}" for n in range(start.size)]
    for name, value, least, most in zip(names, start, low, high, strict=True):
        parameters.add(name, float(value), min=float(least), max=float(most))

    def by_name(now: Any) -> FloatArray:
        return residual(np.array([now[name].value for name in names]))

    found = lmfit.minimize(by_name, parameters)
    return np.array([found.params[name].value for name in names])


def lambertian_peers(albedo: float) -> dict[str, Brdf]:
    """Return Lambert's BRDF by the installed peers, by name: geometries and values (N,), 1/sr."""
    return {name: make(albedo) for name, make in _MAKERS.items() if is_usable(name)}


def _scatmech(albedo: float) -> Brdf:
    module: Any = importlib.import_module("pySCATMECH.brdf")
    model = module.BRDF_Model("Lambertian_BRDF_Model", reflectance=albedo)

    def brdf(geometry: Geometry) -> FloatArray:
        phi = np.pi - np.radians(geometry.dphi_deg)  # measured from the mirror side
        angles = zip(geometry.theta_i, geometry.theta_r, phi, strict=True)
        return np.array([model.BRDF(*map(float, angle)) for angle in angles])

    return brdf


def _mitsuba(albedo: float) -> Brdf:
    mi: Any = importlib.import_module("mitsuba")
    dr: Any = importlib.import_module("drjit")
    mi.set_variant("llvm_ad_rgb")
    bsdf = mi.load_dict({"type": "diffuse", "reflectance": {"type": "rgb", "value": albedo}})

    def brdf(geometry: Geometry) -> FloatArray:
        to_lamp, cos_r = _direction(geometry.theta_i, 0.0), np.cos(geometry.theta_r)
        to_camera = _direction(geometry.theta_r, np.radians(geometry.dphi_deg))
        at = dr.zeros(mi.SurfaceInteraction3f, geometry.theta_i.size)
        at.wi = mi.Vector3f(*(mi.Float(a) for a in to_lamp))
        seen = bsdf.eval(mi.BSDFContext(), at, mi.Vector3f(*(mi.Float(a) for a in to_camera)))
        # Mitsuba's value includes the cosine of the outgoing direction.
        red = np.asarray(seen, dtype=np.float64).reshape(3, -1)[0]
        return np.asarray(red / cos_r)

    return brdf


def _direction(theta: FloatArray, phi: FloatArray | float) -> tuple[FloatArray, ...]:
    sine = np.sin(theta)
    return sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)


_MAKERS: dict[str, Callable[[float], Brdf]] = {"pySCATMECH": _scatmech, "Mitsuba": _mitsuba}
_PROBES: dict[str, Callable[[], tuple[float, float]]] = {
    "lmfit": _probe_lmfit,
    **{name: partial(_probe_lambert, make) for name, make in _MAKERS.items()},
}
