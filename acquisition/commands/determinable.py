"""Parameters that a planned scan can determine, and those that it cannot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.plan.pose import Pose
from analysis.fit.scale_ratios import ratio_names
from analysis.models import MODELS
from instrument.config.protocol import Protocol

# Candidates of up to three parameters whose values a protocol without named models is planned for.
_USUAL = (
    "lambert",
    "oren_nayar",
    "wolff",
    "lambert+torrance_sparrow",
    "oren_nayar+torrance_sparrow",
)


@dataclass(frozen=True, slots=True)
class Determinable:
    """Names of parameters of the models to fit, and of ratios of their scales.

    no: those that the scan will not determine. yes: those that it can, given enough angles.
    """

    yes: tuple[str, ...]
    no: tuple[str, ...]

    @classmethod
    def of(cls, protocol: Protocol, points: Sequence[Pose]) -> Determinable:
        """Of a scan of these geometries by this protocol.

        Without a white tile the radiance is relative, to a lamp level of its own at each of the
        lamp's settings: no scale can be determined, and with one view for each lamp setting
        nothing at all.
        """
        models = [MODELS[name] for name in protocol.fit.models or _USUAL]
        parameters = {p.name: p for model in models for p in model.parameters}
        ratios = dict.fromkeys(ratio for model in models for ratio in ratio_names(model))
        absolute = protocol.references.white_tile is not None
        if not absolute and len({(p.theta_i, p.dphi) for p in points}) == len(points):
            return cls((), (*parameters, *ratios))
        no = [name for name, p in parameters.items() if p.scale and not absolute]
        yes = [name for name in parameters if name not in no]
        return cls((*yes, *ratios), tuple(no))
