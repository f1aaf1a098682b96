"""Plans: what an experiment would see and cost. Made by a job of kind `plan`, read here."""

from fastapi import APIRouter

from app.api.services import Given
from app.api.wire.identifier import Identifier
from app.api.wire.problems import ApiError
from app.experiment.plan import Plan
from app.experiment.plan import read_plan as kept_plan
from app.plan.promise import renewed

router = APIRouter(tags=["plans"])


@router.get("/experiments/{experiment}/plan")
def read_plan(given: Given, experiment: Identifier) -> Plan:
    """Return the newest plan, its times as this machine's runs tell them now; a job of kind `plan` makes it."""
    found = kept_plan(given.folders.open(experiment))
    if found is None:
        raise ApiError("not_found", "This experiment has no plan yet.", "Submit a job of kind plan.")
    return renewed(found)
