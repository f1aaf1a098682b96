"""The base of everything that crosses the API: strict, closed, unchangeable."""

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field

# An id that the service gave, where a request names a thing.
Named = Annotated[str, Field(max_length=100)]


class WireModel(BaseModel):
    """No coercion (`false` is not 0.0), no unknown fields, no NaN, no change after validation."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)

    @classmethod
    def of(cls, status: object) -> Self:
        """Return the resource that shows a status of the application: the same fields by the same names."""
        return cls.model_validate(status, from_attributes=True)
