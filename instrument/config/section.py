"""Base class and common types of the blocks of a configuration file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
# A name is printed in prompts and tables, so it has one line.
Name = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\n\t]*$")]


class Section(BaseModel):
    """Block of a configuration file: strict types, frozen, unknown keys refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Yield the key and the message of each value that contradicts another."""
        yield from ()

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        found = list(self.mistakes())
        if found:
            text = "; ".join(f"{key}: {what}" for key, what in found)
            raise PydanticCustomError("together", "{text}", {"text": text, "found": found})
        return self
