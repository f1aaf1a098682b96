"""`mlp`: the paper's implicit representation, its three losses, mini-batches, Optax (section III-B).

AdaBelief over 80,000 iterations with 8192 collocation points, 5000 pixels and 4096 boundary points is
the recipe as published; the network's size, the learning rate and the weights are not published and are
settings here.
"""

import dataclasses
import time
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import optax

from core.checkpoint import digest
from core.losses.physics import BoundaryLoss, Loss, PhysicsLoss, total
from core.losses.representation import Unknowns
from core.losses.shifts import ShiftLoss
from core.losses.traced import TracedLoss
from core.mlp import Mlp, MlpSettings, initial_mlp
from core.motion import MOTIONS
from core.problem import Problem
from core.result import Outcome, Solution
from core.setting import setting
from core.solve.check import check_problem
from core.solve.loop import LoopSettings, run
from core.solve.network.mlp_start import network_like
from core.solve.nondimensional import frame_of
from core.solve.regime import DataModel, Regime, Weights, losses_of, moved, windows_left_out
from core.solve.solution import solution_of
from core.watch import Watch


@setting
class MlpSolveSettings:
    """The paper's recipe by default.

    `rays`: "network" traces every ray of a mini-batch through the network with `ray_steps` steps, as in
    the paper; "grid" takes the network's temperature on a vertex grid of `ray_cells`, over which rays are
    integrals, so that all of them share one evaluation. README has the price of the first.
    """

    regime: Regime = "bos+pde+boundary"
    network: MlpSettings = MlpSettings()
    loop: LoopSettings = LoopSettings()
    optimiser: Literal["adabelief", "adam", "muon"] = "adabelief"
    learning_rate: float = 1e-3
    decay_steps: int | None = None
    collocation_points: int = 8192
    pixels: int = 5000
    boundary_points: int = 4096
    weights: Weights = Weights()
    data: DataModel = DataModel()
    rays: Literal["grid", "network"] = "grid"
    ray_steps: int = 64
    ray_cells: int = 32
    wall_points: int = 65
    result_vertices: int = 64
    start_steps: int = 2000


def solve_mlp(
    problem: Problem,
    settings: MlpSolveSettings,
    watch: Watch = Watch(),
    *,
    start: Solution | None = None,
) -> Solution:
    """T, p, u on `result_vertices` vertices an axis; `start` is a solution that the network first imitates.

    A run that `watch.store` knows of goes on with the step it was at, and ends bitwise as it would have on a CPU.

    Raises SettingError before the first iteration, ForeignCheckpointError, StoppedError.
    """
    check_problem(problem, settings.regime)
    began = time.perf_counter()
    frame = frame_of(problem)
    n = settings.ray_cells + 1
    losses = losses_of(
        problem,
        frame,
        settings.regime,
        settings.weights,
        settings.data,
        (n, n, n),
        settings.wall_points,
        settings.ray_steps if settings.rays == "network" else None,
    )
    losses = tuple(_with_batches(loss, settings) for loss in losses)
    r = settings.result_vertices

    def growing(unknowns: Unknowns, elapsed_s: float) -> Solution:
        return solution_of(unknowns, frame, (r, r, r), Outcome.step_limit, elapsed_s, ())

    unknowns = initial_unknowns(problem, settings, frame.lower, frame.upper)
    network = unknowns.representation
    if start is not None and isinstance(network, Mlp):
        alike = network_like(network, start, frame, steps=settings.start_steps, seed=settings.loop.seed)
        unknowns = eqx.tree_at(lambda u: u.representation, unknowns, alike)
    found = run(
        _objective,
        unknowns,
        losses,
        _optimiser(settings),
        settings.loop,
        configuration=digest(_lasting(settings), problem, start),
        watch=watch,
        growing=growing,
    )
    notes = (
        f"{settings.network.hidden_layers} x {settings.network.width} {settings.network.activation} network; "
        f"a step needs {found.memory_bytes / 1e6:.0f} MB; compiled in {found.compile_s:.1f} s.",
        *windows_left_out(problem, settings.regime),
    )
    prepared_s = time.perf_counter() - began - found.compile_s
    return solution_of(found.best, frame, (r, r, r), found.outcome, prepared_s, found.history, notes)


def initial_unknowns(
    problem: Problem,
    settings: MlpSolveSettings,
    lower: tuple[float, float, float],
    upper: tuple[float, float, float],
) -> Unknowns:
    """A random network from the loop's seed, and zeros for what else the scene asks for."""
    network = initial_mlp(settings.network, lower, upper, jax.random.key(settings.loop.seed))
    return Unknowns(network, jnp.zeros((len(problem.shifts), MOTIONS)) if moved(problem) else None)


def _lasting(settings: MlpSolveSettings) -> MlpSolveSettings:
    """Without what a resumed run may change: when to end, report and keep."""
    kept = LoopSettings(seed=settings.loop.seed)
    return dataclasses.replace(settings, loop=kept)


def _objective(unknowns: Unknowns, losses: tuple[Loss, ...], key: jax.Array):
    return total(losses, unknowns, key)


def _with_batches(loss: Loss, settings: MlpSolveSettings) -> Loss:
    match loss:
        case ShiftLoss() | TracedLoss():
            return loss.with_batch(settings.pixels)
        case BoundaryLoss():
            return loss.with_batch(settings.boundary_points)
        case PhysicsLoss():
            return loss.with_batch(settings.collocation_points)
        case _:
            return loss


def _optimiser(settings: MlpSolveSettings) -> optax.GradientTransformation:
    rate: Any = settings.learning_rate
    if settings.decay_steps is not None:
        rate = optax.exponential_decay(settings.learning_rate, settings.decay_steps, 0.9)
    match settings.optimiser:
        case "adam":
            return optax.adam(rate)
        case "muon":
            return optax.contrib.muon(rate)
        case _:
            return optax.adabelief(rate)
