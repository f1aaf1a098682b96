"""The device files and hosts that an experiment names: opened only once an operator confirmed them."""

from fastapi import APIRouter

from app.api.models.rigs import AddressesResource, AddressLine, ConfirmAddresses
from app.api.services import Given, Services
from app.api.wire.identifier import Identifier
from app.experiment.folder import Experiment

router = APIRouter(tags=["devices"])


@router.get("/experiments/{experiment}/addresses")
def read_addresses(given: Given, experiment: Identifier) -> AddressesResource:
    """List what the experiment opens, and what of it is confirmed."""
    return _resource(given, given.folders.open(experiment))


@router.put("/experiments/{experiment}/addresses")
def confirm_addresses(given: Given, experiment: Identifier, confirmed: ConfirmAddresses) -> AddressesResource:
    """Confirm, once, that the experiment may open these; they must be the ones that it names now."""
    found = given.folders.open(experiment)
    given.confirmed.confirm(found, confirmed.addresses)
    given.ledger.append_event("experiment", {"experiment": experiment, "confirmed": confirmed.addresses})
    return _resource(given, found)


def _resource(given: Services, experiment: Experiment) -> AddressesResource:
    confirmed = given.confirmed.of(experiment)
    return AddressesResource(
        addresses=[
            AddressLine(address=address, confirmed=address in confirmed)
            for address in experiment.settings.rig.addresses
        ]
    )
