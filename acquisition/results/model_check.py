"""Check of the models that a protocol or an option names, and of their parameters."""

from __future__ import annotations

from collections.abc import Mapping

from analysis.models import MODELS
from instrument.geometry import Geometry


def check_model(name: str, parameters: Mapping[str, float] | None) -> str | None:
    """Return the error of a model's name or parameters, or None; parameters None: name only."""
    try:
        model = MODELS[name]
        if parameters is not None:
            normal = Geometry.from_degrees(theta_i=0.0, theta_r=0.0)
            model.brdf(normal, **parameters)
    except KeyError as error:
        return str(error.args[0])
    except ValueError as error:
        return str(error)
    return None
