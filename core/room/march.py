"""March a room to its steady state, in windows of model time.

The march ends when the mean velocity of a window differs from that of the window before by less than `tolerance`
(relative rms), at `longest_s`, or after `most_steps`. The result is the mean over the last third of the time, since
flows on coarse grids oscillate slowly. If a value becomes infinite, the march returns to the last window and halves
the Courant number, once.

Between two chunks of steps a march can be stopped; it goes on from its last window (`MarchState`).
"""

import math
from collections.abc import Callable
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from core.result import Outcome
from core.room.level import level_correction
from core.room.room_grid import Cells
from core.room.step import Flow, RoomModel, longest_step_s, two_steps
from core.setting import SettingError, setting

# Of the stable step, in the first chunk of a room with objects.
_FIRST_SHARE = 0.3


@setting
class MarchSettings:
    """How long and how finely to march.

    `least_s`: no march is called steady before it; just after a change of the supply windows hardly differ.
    `level_ahead_s`: how far the layers' heat balance is extrapolated after each window (`core.room.level`; 0: not at
    all), from `settle_s` to two thirds of `longest_s`. No window begins after `most_steps`.
    """

    longest_s: float = 60.0
    least_s: float = 0.0
    window_s: float = 5.0
    tolerance: float = 0.02
    courant: float = 0.45
    level_ahead_s: float = 20.0
    settle_s: float = 15.0
    chunk_steps: int = 20
    most_steps: int = 1_000_000

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
    """The end of a march: last state, mean of the last third, how it ended, model time and steps."""

    last: Flow
    mean: Flow
    outcome: Outcome = eqx.field(static=True)
    model_s: float = eqx.field(static=True)
    steps: int = eqx.field(static=True)
    change: float = eqx.field(static=True)


class MarchState(eqx.Module):
    """A march between two windows: all that the next one depends on, and what is kept of those before.

    `means` are of the last third of the windows so far.
    """

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
            outcome = Outcome.step_limit
            break
        state, outcome = _after_window(state, model, settings, check_stop)
        on_window(state)
    mean = _mean(list(state.means)) if state.means else state.flow
    return March(state.flow, mean, outcome, state.model_s, state.steps, state.change)


def _after_window(
    state: MarchState,
    model: RoomModel,
    settings: MarchSettings,
    check_stop: Callable[[], object],
) -> tuple[MarchState, Outcome | None]:
    """The state a window later, and how the march ended if it did so."""
    start, seconds = state.flow, settings.window_s
    # Objects' heat starts plumes that the first state does not show.
    careful = _FIRST_SHARE if model.boundary.solids is not None and state.windows == 0 else 1.0
    mean, flow, taken = _window(start, model, settings, (state.courant, careful), check_stop)
    if not bool(_finite(flow)):
        if state.courant < settings.courant:
            return state, Outcome.nonfinite
        return replace(state, courant=0.5 * state.courant), None
    model_s, windows = state.model_s + seconds, state.windows + 1
    change = float(_relative_change(mean, state.means[-1])) if state.means else float("inf")
    outcome = None
    if change < settings.tolerance and model_s > settings.least_s - 1e-6:
        outcome = Outcome.converged
    elif settings.level_ahead_s > 0 and settings.settle_s < model_s < settings.longest_s * 2 / 3:
        flow = _levelled(flow, (flow.excess_k - start.excess_k) / seconds, model, settings.level_ahead_s)
    # Only the last third is needed, whenever the march ends.
    means = (*state.means, mean)[-_third(windows) :]
    steps = state.steps + taken
    return MarchState(flow, means, state.courant, model_s, steps, windows, change), outcome


def _third(windows: int) -> int:
    return max(1, round(windows / 3))


def _window(
    flow: Flow,
    model: RoomModel,
    settings: MarchSettings,
    courants: tuple[float, float],
    check_stop: Callable[[], object],
) -> tuple[Flow, Flow, int]:
    """Mean over one window, the state at its end, and the steps taken; `courants`: number, and its first share."""
    courant, share = courants
    left_s, means, weights, taken = settings.window_s, [], [], 0
    while left_s > 1e-9:
        check_stop()
        stable_s = float(_longest_step_s(flow, model, courant))
        if not stable_s > 1e-9:
            break
        # Air at rest allows any step; the first ones are short, since it does not stay at rest.
        longest_s = min(share * stable_s, settings.window_s / (2 * settings.chunk_steps))
        pairs, dt_s = chunk_pairs(left_s, longest_s, settings.chunk_steps)
        share = 1.0
        flow, mean = advance_chunk(flow, model, jnp.float32(dt_s), jnp.int32(pairs))
        means.append(mean)
        weights.append(pairs * dt_s)
        taken += 2 * pairs
        left_s -= 2 * pairs * dt_s
    if not means:
        return flow, eqx.tree_at(lambda f: f.excess_k, flow, flow.excess_k * jnp.nan), 0
    return _mean(means, weights), flow, taken


def chunk_pairs(left_s: float, stable_s: float, most: int) -> tuple[int, float]:
    """Pairs of steps of the next chunk, at most `most`, and the step [s]: what is left, in equal stable steps."""
    pairs = max(1, math.ceil(left_s / (2 * stable_s) - 1e-6))
    chunks = math.ceil(pairs / most)
    in_chunk = math.ceil(pairs / chunks)
    return in_chunk, left_s / (2 * chunks * in_chunk)


@eqx.filter_jit
def advance_chunk(
    flow: Flow, model: RoomModel, dt_s: Float[Array, ""], pairs: Int[Array, ""]
) -> tuple[Flow, Flow]:
    """The flow after `pairs` pairs of steps, and its mean over them; one program for any number of them."""

    def body(_: Int[Array, ""], carry: tuple[Flow, Flow]) -> tuple[Flow, Flow]:
        flow, total = carry
        flow = two_steps(flow, model, dt_s)
        return flow, jax.tree.map(jnp.add, total, flow)

    flow, total = lax.fori_loop(0, pairs, body, (flow, jax.tree.map(jnp.zeros_like, flow)))
    count = pairs.astype(jnp.float32)
    return _filled(flow, model), _filled(jax.tree.map(lambda leaf: leaf / count, total), model)


def _filled(flow: Flow, model: RoomModel) -> Flow:
    """The flow with the nearest air's temperature, pressure and turbulence in the cells of objects."""
    solids = model.boundary.solids
    if solids is None:
        return flow
    scalars = flow.excess_k, flow.pressure_m2_s2, flow.turbulence
    return Flow(flow.velocity, *jax.tree.map(solids.filled, scalars))


_longest_step_s = eqx.filter_jit(longest_step_s)


@eqx.filter_jit
def _levelled(flow: Flow, warming_k_s: Cells, model: RoomModel, ahead_s: float) -> Flow:
    return _shifted(flow, level_correction(flow, warming_k_s, model, ahead_s))


def _shifted(flow: Flow, shift_k: Float[Array, " nz"]) -> Flow:
    return eqx.tree_at(lambda f: f.excess_k, flow, flow.excess_k + shift_k[None, None, :])


@eqx.filter_jit
def _finite(flow: Flow) -> Bool[Array, ""]:
    return jnp.all(jnp.array([jnp.all(jnp.isfinite(leaf)) for leaf in jax.tree.leaves(flow)]))


@eqx.filter_jit
def _relative_change(flow: Flow, before: Flow) -> Float[Array, ""]:
    """Relative rms difference of the velocities."""
    moved = sum(jnp.sum((a - b) ** 2) for a, b in zip(flow.velocity, before.velocity, strict=True))
    total = sum(jnp.sum(a**2) for a in flow.velocity)
    return jnp.sqrt(moved / (total + 1e-20))


def _mean(flows: list[Flow], weights: list[float] | None = None) -> Flow:
    share = jnp.asarray(weights or [1.0] * len(flows), jnp.float32)
    share = share / share.sum()
    return jax.tree.map(lambda *leaves: sum(w * leaf for w, leaf in zip(share, leaves, strict=True)), *flows)
