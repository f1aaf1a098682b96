"""March a room to its steady state, in windows of model time.

The march ends when the mean velocity of a window differs from that of the window before by less than `tolerance`
(relative rms), at `longest_s`, or after `most_steps`. The result is the mean over the last windows, as many as the
room's unrest asks for (`core.room.unrest`). If a value becomes infinite, the march returns to the last window and
halves the Courant number, once.

Time is what the room's cells have lived through in the mean: each takes its own steps (`core.room.pace`).

Between two chunks of steps a march can be stopped; it goes on from its last window (`MarchState`).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Int

from core.result import Outcome
from core.room.eddies import LargeEddies, stirred
from core.room.level import level_correction
from core.room.pace import StepLimits, step_limits
from core.room.room_grid import Cells
from core.room.step import Flow, RoomModel, own_pace, two_steps
from core.room.unrest import settled_windows
from core.setting import SettingError, setting

# Of the stable Courant number, in the first chunk of a room with objects.
_FIRST_SHARE = 0.3
# A window is over when less than this share of it is left.
_NOTHING = 1e-5


@setting
class MarchSettings:
    """How long and how finely to march.

    `least_s`: no march is called steady before it; just after a change of the supply windows hardly differ.
    `level_ahead_s`: how far the layers' heat balance is extrapolated after each window (`core.room.level`; 0: not at
    all), from `settle_s` to two thirds of `longest_s`. No window begins after `most_steps`. A march that ends by its
    longest time counts as converged if its last windows differ by less than `settled`, else as unsteady. One that is
    not `steady` is true in time: all cells take the same steps, and no wave is damped.
    `mean_windows`: the result is the mean over so many of the last windows; None takes as many as the room's unrest
    asks for.
    """

    longest_s: float = 60.0
    least_s: float = 0.0
    window_s: float = 15.0
    tolerance: float = 0.002
    settled: float = 0.02
    courant: float = 0.45
    level_ahead_s: float = 20.0
    settle_s: float = 15.0
    chunk_steps: int = 20
    most_steps: int = 1_000_000
    steady: bool = True
    mean_windows: int | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.courant <= 0.5:
            raise SettingError(
                f"Courant number {self.courant:g}; the explicit march is stable from 0 to 0.5. "
                "Lower courant, or leave it at its default."
            )
        if self.longest_s < self.window_s or self.window_s <= 0:
            raise SettingError(
                f"A march of {self.longest_s:g} s cannot be watched in windows of {self.window_s:g} s; "
                "give window_s above 0 and at most longest_s."
            )


class March(eqx.Module):
    """The end of a march: last state, mean of the last windows and how many, how it ended, model time and steps."""

    last: Flow
    mean: Flow
    outcome: Outcome = eqx.field(static=True)
    model_s: float = eqx.field(static=True)
    steps: int = eqx.field(static=True)
    change: float = eqx.field(static=True)
    mean_windows: int = eqx.field(static=True)


class MarchState(eqx.Module):
    """A march between two windows: all that the next one depends on, and the means of those before."""

    flow: Flow
    means: tuple[Flow, ...] = ()
    courant: float = 0.0
    model_s: float = 0.0
    steps: int = 0
    windows: int = 0
    change: float = float("inf")


def march(
    flow: Flow,
    model: RoomModel,
    settings: MarchSettings,
    *,
    begun: MarchState | None = None,
    on_window: Callable[[MarchState], object] = lambda state: None,
    check_stop: Callable[[], object] = lambda: None,
) -> March:
    """March `flow` to its steady state.

    A march that was `begun` goes on to the same bits. `check_stop` is called between two chunks, and may raise.
    """
    state = begun or MarchState(flow, courant=settings.courant)
    outcome = None
    while outcome is None:
        if state.model_s >= settings.longest_s - 1e-6 or state.steps >= settings.most_steps:
            changing = Outcome.step_limit if state.steps >= settings.most_steps else Outcome.unsteady
            outcome = Outcome.converged if state.change < settings.settled else changing
            break
        state, outcome = _after_window(state, model, settings, check_stop)
        on_window(state)
    means = state.means or (state.flow,)
    last = min(len(means), settings.mean_windows or settled_windows(means))
    return March(state.flow, _mean(means[-last:]), outcome, state.model_s, state.steps, state.change, last)


def _after_window(
    state: MarchState,
    model: RoomModel,
    settings: MarchSettings,
    check_stop: Callable[[], object],
) -> tuple[MarchState, Outcome | None]:
    """The state a window later, and how the march ended if it did so."""
    start, seconds = state.flow, settings.window_s
    mean, flow, lived_s, taken = window(start, model, settings, state, check_stop)
    if not _finite(flow):
        if state.courant < settings.courant:
            return state, Outcome.nonfinite
        return replace(state, courant=0.5 * state.courant), None
    model_s, windows = state.model_s + seconds, state.windows + 1
    change = float(_relative_change(mean, state.means[-1])) if state.means else float("inf")
    outcome = None
    if change < settings.tolerance and model_s > settings.least_s - 1e-6:
        outcome = Outcome.converged
    elif settings.level_ahead_s > 0 and settings.settle_s < model_s < settings.longest_s * 2 / 3:
        # As an array the time ahead is no part of the compiled program.
        ahead_s = jnp.asarray(settings.level_ahead_s, jnp.float32)
        flow = _levelled(flow, (flow.excess_k - start.excess_k) / lived_s, model, ahead_s)
    steps = state.steps + taken
    return MarchState(flow, (*state.means, mean), state.courant, model_s, steps, windows, change), outcome


def window(
    flow: Flow,
    model: RoomModel,
    settings: MarchSettings,
    state: MarchState,
    check_stop: Callable[[], object],
) -> tuple[Flow, Flow, Cells, int]:
    """Mean over one window, the state at its end, the time that each cell has lived [s], and the steps taken."""
    left_s, means, weights, taken = settings.window_s, [], [], 0
    lived_s = jnp.zeros(model.grid.cells)
    most = settings.chunk_steps
    pairs, first = most, state.windows == 0
    boundary = model.boundary
    while left_s > _NOTHING * settings.window_s:
        check_stop()
        # Air at rest allows any step, but it does not stay at rest; objects' heat starts plumes.
        careful = _FIRST_SHARE if first and model.boundary.solids is not None else 1.0
        longest_s = min(settings.window_s / (2 * most), left_s / (2 * pairs))
        if isinstance(model.closure, LargeEddies):
            disturbed = stirred(boundary, jnp.int32(state.steps + taken))
            model = eqx.tree_at(lambda m: m.boundary, model, disturbed)
        limits = step_limits(careful * state.courant, longest_s, steady=settings.steady, first=first)
        flow, mean, own_s = advance_chunk(flow, model, jnp.int32(pairs), limits)
        passed_s = float(own_s.mean())
        if not passed_s > 1e-9:
            break
        means.append(mean)
        weights.append(float(pairs))
        lived_s, taken, left_s, first = lived_s + own_s, taken + 2 * pairs, left_s - passed_s, False
        # The next chunk, if the room goes on at this pace: what is left, in as many pairs as it takes.
        pairs = max(1, min(most, round(0.5 + left_s * pairs / passed_s)))
    if not means:
        return flow, eqx.tree_at(lambda f: f.excess_k, flow, flow.excess_k * jnp.nan), lived_s, 0
    return _mean(means, weights), flow, lived_s, taken


@eqx.filter_jit
def advance_chunk(
    flow: Flow, model: RoomModel, pairs: Int[Array, ""], limits: StepLimits
) -> tuple[Flow, Flow, Cells]:
    """The flow after `pairs` pairs of steps, its mean over them, and the time that each cell has lived [s]."""

    def body(_: Int[Array, ""], carry: tuple[Flow, Flow, Cells]) -> tuple[Flow, Flow, Cells]:
        flow, total, lived_s = carry
        pace = own_pace(flow, model, limits)
        flow = two_steps(flow, model, pace)
        return flow, jax.tree.map(jnp.add, total, flow), lived_s + 2.0 * pace.own_s

    start = flow, jax.tree.map(jnp.zeros_like, flow), jnp.zeros(model.grid.cells)
    flow, total, lived_s = lax.fori_loop(0, pairs, body, start)
    count = pairs.astype(jnp.float32)
    return _filled(flow, model), _filled(jax.tree.map(lambda leaf: leaf / count, total), model), lived_s


def _filled(flow: Flow, model: RoomModel) -> Flow:
    """The flow with the nearest air's temperature, pressure and turbulence in the cells of objects."""
    solids = model.boundary.solids
    if solids is None:
        return flow
    scalars = flow.excess_k, flow.pressure_m2_s2, flow.turbulence
    return Flow(flow.velocity, *jax.tree.map(solids.filled, scalars))


@eqx.filter_jit
def _levelled(flow: Flow, warming_k_s: Cells, model: RoomModel, ahead_s: Float[Array, ""]) -> Flow:
    return _shifted(flow, level_correction(flow, warming_k_s, model, ahead_s))


def _shifted(flow: Flow, shift_k: Float[Array, " nz"]) -> Flow:
    return eqx.tree_at(lambda f: f.excess_k, flow, flow.excess_k + shift_k[None, None, :])


def _finite(flow: Flow) -> bool:
    return all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(flow))


@eqx.filter_jit
def _relative_change(flow: Flow, before: Flow) -> Float[Array, ""]:
    """Relative rms difference of the velocities."""
    moved = sum(jnp.sum((a - b) ** 2) for a, b in zip(flow.velocity, before.velocity, strict=True))
    total = sum(jnp.sum(a**2) for a in flow.velocity)
    return jnp.sqrt(moved / (total + 1e-20))


def _mean(flows: Sequence[Flow], weights: list[float] | None = None) -> Flow:
    share = jnp.asarray(weights or [1.0] * len(flows), jnp.float32)
    share = share / share.sum()
    return jax.tree.map(lambda *leaves: sum(w * leaf for w, leaf in zip(share, leaves, strict=True)), *flows)
