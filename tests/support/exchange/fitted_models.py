"""Fitted models as an export has them."""

from __future__ import annotations

from dataclasses import replace

from analysis.exchange.exported import Export, ExportedModel
from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry


def fitted(name: str, **values: float) -> ExportedModel:
    """Model as a fit would give it: those of its parameters that are not named at their default."""
    model = MODELS[name]
    values = {p.name: values.get(p.name, p.default) for p in model.parameters}

    def brdf(geometry: Geometry) -> FloatArray:
        """BRDF in 1/sr of the geometry's shape."""
        return model.brdf(geometry, **values)

    u = {parameter: None if i else 0.01 for i, parameter in enumerate(values)}
    return ExportedModel(name=name, verdict="adequate", values=values, u=u, brdf=brdf)


def explained_by(model: ExportedModel, export: Export) -> Export:
    """The same angles and facts, with values that the model gives exactly."""
    table = replace(export.table, brdf=model.brdf(export.table.geometry))
    return replace(export, table=table, model=model)
