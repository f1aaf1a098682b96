"""The loop of a gradient method: one compiled step, rows, checkpoints, and a named end.

The step is compiled once, before the loop, for this state and data: it cannot recompile, and its memory
is known before it runs. Mini-batches are a function of (seed, step), so a resumed run repeats bitwise on
a CPU. The best state by the smoothed loss is kept; a step that makes anything not finite is not taken.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray, PyTree

from core.checkpoint import claim, encode, keep, newest, restore
from core.result import Outcome, Solution
from core.setting import SettingError, setting
from core.watch import Growing, Row, StoppedError, Store, Watch

Objective = Callable[[PyTree, PyTree, PRNGKeyArray], tuple[Float[Array, ""], dict[str, Float[Array, ""]]]]

_SMOOTHING = 0.98
# A step that takes longer is waited for in slices, so that a request to stop is heard meanwhile.
_LONGEST_WAIT_S = 0.5


@setting
class LoopSettings:
    """When to report, keep and stop. `patience` steps without a gain of `least_gain` end in a plateau."""

    steps: int = 80_000
    record_every: int = 100
    patience: int = 20_000
    least_gain: float = 1e-3
    time_limit_s: float | None = None
    checkpoint_every_s: float = 60.0
    checkpoint_every_steps: int | None = None
    seed: int = 0
    memory_limit_bytes: int | None = None

    def __post_init__(self) -> None:
        if self.steps < 1 or self.record_every < 1 or self.patience < 1:
            raise SettingError(
                f"Loop of {self.steps} steps, a record every {self.record_every}, patience {self.patience}; "
                "expected at least 1 of each."
            )


class LoopState(eqx.Module):
    """Everything that the next step depends on."""

    unknowns: PyTree
    optimiser: PyTree
    best: PyTree
    best_loss: Float[Array, ""]
    smooth_loss: Float[Array, ""]
    step: Int[Array, ""]
    best_step: Int[Array, ""]
    finite: Bool[Array, ""]


@dataclass(frozen=True)
class LoopResult:
    """The best unknowns, how it ended, and what it took."""

    best: PyTree
    last: PyTree
    outcome: Outcome
    history: tuple[Row, ...]
    compile_s: float
    run_s: float
    memory_bytes: int


def run(
    objective: Objective,
    unknowns: PyTree,
    data: PyTree,
    optimiser: optax.GradientTransformation,
    settings: LoopSettings,
    *,
    configuration: str,
    watch: Watch = Watch(),
    growing: Callable[[PyTree, float], Solution] | None = None,
) -> LoopResult:
    """Minimise `objective(unknowns, data, key)` over the inexact arrays of `unknowns`.

    `growing(unknowns, elapsed_s)` is the air as it is then, for whoever watches.

    Raises SettingError if the step needs more memory than `memory_limit_bytes`, ForeignCheckpointError if the
    store does not belong to this configuration, StoppedError where a stop was asked for, its state kept.
    """
    store = watch.store
    state = _initial(unknowns, optimiser)
    history: list[Row] = []
    if store is not None:
        claim(store, configuration)
    found = newest(store) if store is not None else None
    if found is not None:
        state = restore(found, state, configuration=configuration)
        history = list(found.header["history"])
    began = time.perf_counter()
    step = _compile(objective, optimiser, settings, state, data)
    compile_s, memory = time.perf_counter() - began, _memory_bytes(step)
    watch.tell({"doing": "compiled", "compile_s": compile_s, "memory_bytes": float(memory)})
    if settings.memory_limit_bytes is not None and memory > settings.memory_limit_bytes:
        raise SettingError(
            f"A step needs {memory / 1e9:.2f} GB, and "
            f"{settings.memory_limit_bytes / 1e9:.2f} GB may be used. "
            "Take smaller batches or a smaller network."
        )
    keeper = _Keeper(store, settings, configuration)
    began = time.perf_counter()
    outcome, slow = None, True
    while outcome is None:
        started = time.perf_counter()
        following, parts = step(state, data)
        if slow and not _arrived(following.step, watch.should_stop):
            # What this step began is given up: the state before it is kept within a second.
            keeper.save_if_due(state, history, final=True)
            raise StoppedError
        state, number = following, int(following.step)
        slow = time.perf_counter() - started > _LONGEST_WAIT_S
        due = number % settings.record_every == 0 or number == settings.steps
        if due or not bool(state.finite):
            elapsed_s = time.perf_counter() - began
            history.append(_record(state, parts, elapsed_s, settings))
            watch.tell(history[-1], _grown(growing, state.unknowns, elapsed_s))
        outcome = _ended(state, settings, began)
        stopped = outcome is None and watch.should_stop()
        keeper.save_if_due(state, history, final=stopped)
        if stopped:
            raise StoppedError
    run_s = time.perf_counter() - began
    return LoopResult(state.best, state.unknowns, outcome, tuple(history), compile_s, run_s, memory)


def _arrived(value: Array, should_stop: Callable[[], bool]) -> bool:
    """Wait for a step that is being worked out in the background; False where a stop was asked for first."""
    while not value.is_ready():  # pyright: ignore[reportAttributeAccessIssue]
        if should_stop():
            return False
        time.sleep(0.05)
    return True


def _initial(unknowns: PyTree, optimiser: optax.GradientTransformation) -> LoopState:
    infinite = jnp.float32(np.inf)
    state = optimiser.init(eqx.filter(unknowns, eqx.is_inexact_array))
    zero = jnp.int32(0)
    return LoopState(unknowns, state, unknowns, infinite, infinite, zero, zero, jnp.array(True))


def _compile(
    objective: Objective,
    optimiser: optax.GradientTransformation,
    settings: LoopSettings,
    state: LoopState,
    data: PyTree,
) -> Callable[[LoopState, PyTree], tuple[LoopState, dict[str, Float[Array, ""]]]]:
    """Ahead of time, for exactly these shapes: another shape would be an error, never a recompilation."""

    def advance(state: LoopState, data: PyTree) -> tuple[LoopState, dict[str, Float[Array, ""]]]:
        key = jax.random.fold_in(jax.random.key(settings.seed), state.step)
        free, fixed = eqx.partition(state.unknowns, eqx.is_inexact_array)

        def value(free: PyTree) -> tuple[Float[Array, ""], dict[str, Float[Array, ""]]]:
            return objective(eqx.combine(free, fixed), data, key)

        (loss, parts), gradient = jax.value_and_grad(value, has_aux=True)(free)
        with jax.numpy_dtype_promotion("standard"):  # Optax mixes its integer step count with floats
            updates, moved = optimiser.update(gradient, state.optimiser, free)
        return _accept(state, eqx.apply_updates(state.unknowns, updates), moved, loss, settings), {
            "loss": loss,
            **parts,
        }

    return eqx.filter_jit(advance).lower(state, data).compile()  # pyright: ignore


def _accept(
    state: LoopState, unknowns: PyTree, optimiser: PyTree, loss: Float[Array, ""], settings: LoopSettings
) -> LoopState:
    """Take the step if everything is finite; keep the unknowns that it started from if they are best."""
    leaves = [a for a in jax.tree.leaves((unknowns, loss)) if eqx.is_inexact_array(a)]
    finite = jnp.stack([jnp.isfinite(a).all() for a in leaves]).all()
    blended = _SMOOTHING * state.smooth_loss + (1.0 - _SMOOTHING) * loss
    smooth = jnp.where(state.step == 0, loss, blended)
    better = finite & (smooth < state.best_loss)
    gained = finite & (smooth < (1.0 - settings.least_gain) * state.best_loss)
    return LoopState(
        unknowns=_choose(finite, unknowns, state.unknowns),
        optimiser=_choose(finite, optimiser, state.optimiser),
        best=_choose(better, state.unknowns, state.best),
        best_loss=jnp.where(gained, smooth, state.best_loss),
        smooth_loss=jnp.where(finite, smooth, state.smooth_loss),
        step=state.step + 1,
        best_step=jnp.where(gained, state.step, state.best_step),
        finite=finite,
    )


def _choose(condition: Bool[Array, ""], yes: PyTree, no: PyTree) -> PyTree:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b) if eqx.is_array(a) else a, yes, no)


def _grown(
    growing: Callable[[PyTree, float], Solution] | None, unknowns: PyTree, elapsed_s: float
) -> Growing | None:
    return None if growing is None else lambda: growing(unknowns, elapsed_s)


def _ended(state: LoopState, settings: LoopSettings, began: float) -> Outcome | None:
    number = int(state.step)
    if not bool(state.finite):
        return Outcome.nonfinite
    if number >= settings.steps:
        return Outcome.step_limit
    if number - int(state.best_step) > settings.patience:
        return Outcome.plateau
    if settings.time_limit_s is not None and time.perf_counter() - began > settings.time_limit_s:
        return Outcome.time_limit
    return None


def _record(
    state: LoopState, parts: dict[str, Float[Array, ""]], elapsed_s: float, settings: LoopSettings
) -> Row:
    numbers = {name: float(value) for name, value in parts.items()}
    step = float(state.step)
    share = step / settings.steps
    return {"doing": "optimise", "step": step, "share": share, "elapsed_s": elapsed_s, **numbers}


def _memory_bytes(step: Any) -> int:
    """Arguments, results and scratch of the compiled step, as the compiler planned them."""
    plan = step.compiled.memory_analysis()
    if plan is None:
        return 0
    return int(plan.temp_size_in_bytes + plan.argument_size_in_bytes + plan.output_size_in_bytes)


class _Keeper:
    """Saves at most every min(checkpoint_every_s, 1 % of the run), at a cost of at most 1 %."""

    def __init__(self, store: Store | None, settings: LoopSettings, configuration: str) -> None:
        self._store, self._settings, self._configuration = store, settings, configuration
        self._began = self._last = time.perf_counter()
        self._cost_s = 0.0
        self._first: int | None = None

    def save_if_due(self, state: LoopState, history: list[Row], *, final: bool) -> None:
        """Write a checkpoint if it is time or the last chance."""
        number = int(state.step)
        self._first = number if self._first is None else self._first
        if self._store is None or not (final or self._due(number)):
            return
        began = time.perf_counter()
        content = encode(
            state, configuration=self._configuration, step=number, seed=self._settings.seed, history=history
        )
        keep(self._store, content)
        self._last = time.perf_counter()
        self._cost_s = self._last - began

    def _due(self, number: int) -> bool:
        every = self._settings.checkpoint_every_steps
        if every is not None:
            return number % every == 0
        now = time.perf_counter()
        done = number - (self._first or 0) + 1
        whole_s = (now - self._began) / done * self._settings.steps
        wait_s = max(min(self._settings.checkpoint_every_s, 0.01 * whole_s), 100 * self._cost_s)
        return now - self._last >= wait_s
