"""How much a room's fit marches, as a rule: for the plan before it, and for the share that is done during it."""

from core.estimate.forward_runs import RoomSettings
from core.estimate.marches import work
from core.estimate.prior import Prior
from core.room.forward import Room

# Corrections of a fine room before none gains any more, its walls stated or not.
_STATED_ROUNDS, _UNKNOWN_ROUNDS = 3, 6


def fit_work(coarse: Room, fine: Room, prior: Prior, settings: RoomSettings) -> float:
    """The `work` of every march together."""
    coarse_s, fine_s = marched_s(prior, settings)
    return work(coarse.grid, coarse_s) + work(fine.grid, fine_s)


def marched_s(prior: Prior, settings: RoomSettings) -> tuple[float, float]:
    """Model seconds of the coarse and of the fine room."""
    restart_s = settings.restarts_s(prior)
    restarts = (1 + len(prior.active())) * restart_s
    # Walls that nobody has stated move far: derivatives are made again, and corrections go on.
    far = bool(prior.unknown_walls())
    rounds = min(settings.rounds, _UNKNOWN_ROUNDS if far else _STATED_ROUNDS)
    # One coarse correction that is tried, and the second closure's run, beside the Jacobian's.
    coarse_s = settings.settle_s + (1 + settings.renewals * far) * restarts + 2 * restart_s
    # The room as stated, and each round.
    fine_s = (1 + rounds) * settings.refine_s
    return coarse_s, fine_s
