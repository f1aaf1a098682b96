"""The devices that an experiment names, and the operator's word that it may open them."""

from typing import Annotated

from pydantic import Field

from app.api.models.strict import WireModel


class AddressLine(WireModel):
    """A device file or a host, and whether an operator confirmed it."""

    address: str
    confirmed: bool


class AddressesResource(WireModel):
    """What an experiment opens; empty for a simulated rig."""

    addresses: list[AddressLine]


class ConfirmAddresses(WireModel):
    """The addresses as they were shown to the operator."""

    addresses: list[Annotated[str, Field(max_length=1000)]] = Field(max_length=10)
