"""Versions of the libraries that a result may depend on in its last digits."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

LIBRARIES = ("numpy", "scipy", "opencv-contrib-python-headless")


def versions_of(*packages: str) -> dict[str, str]:
    """Return the installed version of each package, or "unknown" where it is not installed."""
    return {package: _version(package) for package in packages}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
