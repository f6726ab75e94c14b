"""Sample of a simulated rig: its true reflectance, which real rigs and the fit ignore."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from instrument.config.section import Finite, Name, Section

_Albedo = Annotated[float, Field(ge=0, le=1)]
ChannelAlbedos = Annotated[list[_Albedo], Field(min_length=3, max_length=3)]


class Variation(Section):
    """Places of a simulated sample with other `parameters` of its model than the rest.

    `pattern`: `halves`, those at x > 0; `gradient`, to which all change evenly along x, from the
    left edge to the right one; `patch`, a square of `size_mm` in the middle. `channel_albedos`: as
    those of the sample.
    """

    pattern: Literal["halves", "gradient", "patch"]
    parameters: Annotated[dict[str, Finite], Field(min_length=1)]
    size_mm: Annotated[float, Field(gt=0, le=500)] = 10.0
    channel_albedos: ChannelAlbedos | None = None

    def in_channel(self, channel: int) -> Variation:
        """Return the variation as a channel of a colour camera sees it."""
        own = self.channel_albedos
        if own is None:
            return self
        values = {**self.parameters, "albedo": own[channel]}
        return self.model_copy(update={"parameters": values, "channel_albedos": None})


class SimulatedSample(Section):
    """True reflectance of the sample on a simulated rig; real rigs and the fit ignore it.

    `method` of computing its reflectance; auto: the cheapest that is accurate enough for the image.
    `mottling`: relative standard deviation of the albedo over the surface, in patches of
    `mottling_size_mm`; its logarithm is normally distributed, so that no place reflects less than
    nothing. `variation`: places with other parameters. `channel_albedos`: albedo in the red, green
    and blue channel of a colour camera; any other camera sees that of `parameters`.
    """

    model: Name
    parameters: dict[str, Finite]
    method: Literal["auto", "exact"] = "auto"
    mottling: Annotated[float, Field(ge=0, le=0.3)] = 0.0
    mottling_size_mm: Annotated[float, Field(ge=0.2, le=1000)] = 2.0
    variation: Variation | None = None
    channel_albedos: ChannelAlbedos | None = None

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Require an albedo where it differs from channel to channel, in all places or none."""
        if self.channel_albedos is not None and "albedo" not in self.parameters:
            yield (
                "channel_albedos",
                f"beside parameters without an albedo; allowed: with a model that has one, and "
                f"{self.model} as it is given has {', '.join(self.parameters) or 'none'}",
            )
        other = self.variation
        if other is not None and (other.channel_albedos is None) != (self.channel_albedos is None):
            where = "the sample" if self.channel_albedos is None else "its variation"
            yield "channel_albedos", f"is missing of {where}; allowed: of both or of neither"

    def in_channel(self, channel: int) -> SimulatedSample:
        """Return the sample as a channel of a colour camera sees it, 0 for red."""
        own, other = self.channel_albedos, self.variation
        if own is None:
            return self
        return self.model_copy(
            update={
                "parameters": {**self.parameters, "albedo": own[channel]},
                "variation": None if other is None else other.in_channel(channel),
                "channel_albedos": None,
            }
        )

    def with_share(self, share: float) -> SimulatedSample:
        """Return the sample where `share` of the way to the variation's parameters is gone."""
        if self.variation is None:
            return self
        other = {**self.parameters, **self.variation.parameters}
        values = {k: (1 - share) * v + share * other[k] for k, v in self.parameters.items()}
        return self.model_copy(update={"parameters": values})
