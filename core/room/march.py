"""March a room to its steady state, in windows of model time.

The march ends when the mean velocity of a window differs from that of the window before by less than `tolerance`
(relative rms), at `longest_s`, or after `most_steps`. The result is the mean over the last third of the time, since
flows on coarse grids oscillate slowly. The mean temperature of the room, or of every layer, can be held: the air is
shifted to it after each window. If a value becomes infinite, the march returns to the last window and halves the
Courant number, once.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Bool, Float

from core.result import Outcome
from core.room.level import level_correction
from core.room.room_grid import Cells
from core.room.step import Flow, RoomModel, longest_step_s, two_steps
from core.setting import SettingError, setting


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
    """The end of a march: last state, mean of the last third, how it ended, model time and steps.

    `held_k_s` is the heating rate that held the temperatures, as a mean over the room and the last third.
    """

    last: Flow
    mean: Flow
    held_k_s: float | None = eqx.field(static=True)
    outcome: Outcome = eqx.field(static=True)
    model_s: float = eqx.field(static=True)
    steps: int = eqx.field(static=True)
    change: float = eqx.field(static=True)


def march(
    flow: Flow,
    model: RoomModel,
    settings: MarchSettings,
    *,
    held_k: Float[Array, " layers"] | None = None,
    on_window: Callable[[dict[str, Any]], object] | None = None,
) -> March:
    """March `flow` to its steady state; `held_k` holds the mean excess temperature of each layer, or of the room."""
    windows: list[Flow] = []
    held: list[float] = []
    seconds = settings.window_s
    courant, model_s, steps, marched, change = settings.courant, 0.0, 0, 0, float("inf")
    outcome = Outcome.step_limit
    while model_s < settings.longest_s - 1e-6 and steps < settings.most_steps:
        start = flow
        mean, new, taken = _window(start, model, settings, courant)
        if not bool(_finite(new)):
            if courant < settings.courant:
                outcome = Outcome.nonfinite
                break
            courant *= 0.5
            continue
        model_s, steps = model_s + seconds, steps + taken
        change = float(_relative_change(mean, windows[-1])) if windows else float("inf")
        marched += 1
        # Only the last third is needed, whenever the march ends.
        windows = [*windows, mean][-_third(marched) :]
        if on_window is not None:
            # The middle of the room as it is now, for somebody to watch it grow.
            plane = np.asarray(mean.excess_k[:, mean.excess_k.shape[1] // 2], np.float32)
            on_window({"model_s": model_s, "change": change, "excess_plane_k": plane})
        flow = new
        if change < settings.tolerance and model_s > settings.least_s - 1e-6:
            outcome = Outcome.converged
            break
        if held_k is not None:
            found_k = mean.excess_k.mean((0, 1))
            shift_k = held_k - (found_k if held_k.size > 1 else found_k.mean())
            held = [*held, float(shift_k.mean()) / seconds][-_third(marched) :]
            flow = _shifted(new, shift_k)
        elif settings.level_ahead_s > 0 and settings.settle_s < model_s < settings.longest_s * 2 / 3:
            flow = _levelled(new, (new.excess_k - start.excess_k) / seconds, model, settings.level_ahead_s)
    mean = _mean(windows) if windows else flow
    return March(flow, mean, float(np.mean(held)) if held else None, outcome, model_s, steps, change)


def _third(windows: int) -> int:
    return max(1, round(windows / 3))


def _window(flow: Flow, model: RoomModel, settings: MarchSettings, courant: float) -> tuple[Flow, Flow, int]:
    """Mean over one window, the state at its end, and the steps taken."""
    left_s, means, weights = settings.window_s, [], []
    while left_s > 1e-9:
        stable_s = float(_longest_step_s(flow, model, courant))
        if not stable_s > 1e-9:
            break
        dt_s = min(stable_s, left_s / (2 * settings.chunk_steps))
        flow, mean = advance_chunk(flow, model, jnp.float32(dt_s), settings.chunk_steps)
        means.append(mean)
        weights.append(dt_s)
        left_s -= 2 * settings.chunk_steps * dt_s
    if not means:
        return flow, eqx.tree_at(lambda f: f.excess_k, flow, flow.excess_k * jnp.nan), 0
    return _mean(means, weights), flow, 2 * settings.chunk_steps * len(means)


@eqx.filter_jit
def advance_chunk(flow: Flow, model: RoomModel, dt_s: Float[Array, ""], pairs: int) -> tuple[Flow, Flow]:
    """The flow after `pairs` pairs of steps, and its mean over them."""

    def body(carry: tuple[Flow, Flow], _: None) -> tuple[tuple[Flow, Flow], None]:
        flow, total = carry
        flow = two_steps(flow, model, dt_s)
        return (flow, jax.tree.map(jnp.add, total, flow)), None

    zero = jax.tree.map(jnp.zeros_like, flow)
    (flow, total), _ = lax.scan(body, (flow, zero), length=pairs)
    return flow, jax.tree.map(lambda leaf: leaf / pairs, total)


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
