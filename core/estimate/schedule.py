"""How much a room's fit marches, as a rule: for the plan before it, and for the share that is done during it."""

from core.estimate.forward_runs import RoomSettings
from core.estimate.marches import work
from core.estimate.prior import Prior
from core.room.forward import Room

# Steps of a search before none gains any more.
_ROUNDS = 6


def fit_work(coarse: Room, fine: Room, prior: Prior, settings: RoomSettings) -> float:
    """The `work` of every march together."""
    coarse_s, fine_s = marched_s(prior, settings)
    return work(coarse.grid, coarse_s) + work(fine.grid, fine_s)


def marched_s(prior: Prior, settings: RoomSettings) -> tuple[float, float]:
    """Model seconds of the coarse and of the fine room."""
    restart_s = settings.restarts_s(prior)
    restarts = (1 + len(prior.active())) * restart_s
    # The Jacobian and its renewals, and the second closure's run.
    coarse_s = settings.settle_s + (1 + settings.renewals) * restarts + restart_s
    # The room as stated, and each step.
    fine_s = (1 + min(settings.rounds, _ROUNDS)) * settings.refine_s
    return coarse_s, fine_s
