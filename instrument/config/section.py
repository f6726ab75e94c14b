"""What every block of a configuration file is: strict, frozen, without unknown keys."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
# In one line: a name is printed in prompts and tables.
Name = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\n\t]*$")]


class Section(BaseModel):
    """A block of a configuration file: frozen, strict, without unknown keys."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Values that do not go together: the key to point at, and what is wrong with it."""
        yield from ()

    @model_validator(mode="after")
    def _goes_together(self) -> Self:
        found = list(self.mistakes())
        if found:
            text = "; ".join(f"{key}: {what}" for key, what in found)
            raise PydanticCustomError("together", "{text}", {"text": text, "found": found})
        return self
