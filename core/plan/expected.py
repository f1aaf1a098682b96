"""The flow that a scene lets one expect: good enough for the size and shape of a shift.

If a supply or heaters are stated the room is marched on a coarse grid (seconds); otherwise a plume of the largest
known contrast stands in the middle of the room. The shift is right within a factor of about 1.5.
"""

from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from core.air import Air
from core.estimate.forward_runs import RoomSettings, run_as_stated
from core.estimate.marches import Marches
from core.estimate.plane_openings import with_planes_read
from core.estimate.prior import room_prior
from core.fields import SplineField, plume, through_vertices
from core.known import measured_outlets
from core.known_temperature import VertexGrid
from core.plan.averaging import Fluctuation, fluctuation
from core.problem import Problem
from core.room.forward import closure_name, room
from core.room.march import MarchSettings
from core.room.pace import step_limits
from core.room.step import own_pace
from core.scene import Driving, Heater, Inlet, Scene, Wall
from core.setting import SettingError
from core.view_frame import Turn

Volume = Float[np.ndarray, "nx ny nz"]

# Without any statement about the air: what a person or a computer makes.
DEFAULT_EXCESS_K = 10.0
_COARSE = RoomSettings(coarse_cells=20, settle_s=180.0)
_VERTICES = 33


@dataclass(frozen=True)
class ExpectedFlow:
    """Excess temperature on a vertex grid, and in words where it comes from; the rest if it was marched.

    `step_s` is the mean over cells of `cell_m` of their stable time steps, for the cost of finer marches;
    `fluctuation` is how the air would move about this mean, where a closure tells.
    """

    grid: VertexGrid
    excess_k: Volume
    source: str
    step_s: float | None = None
    cell_m: float | None = None
    turnover_ratio: float = 1.0
    fluctuation: Fluctuation | None = None

    def excess_refractivity(self, air: Air) -> Float[Array, "nx ny nz"]:
        """N - N0 on the vertices."""
        return air.excess_refractivity(jnp.asarray(self.excess_k, jnp.float32))

    def facing(self, turn: Turn) -> "ExpectedFlow":
        """The same flow in a view's own frame."""
        if turn.is_none:
            return self
        grid = VertexGrid(turn.box(self.grid.box), turn.shape(self.grid.shape))
        return replace(self, grid=grid, excess_k=np.asarray(turn.volume(jnp.asarray(self.excess_k))))

    def field(self, air: Air) -> SplineField:
        """Smooth through the vertices: the slope of a trilinear field jumps, that of air does not."""
        box = self.grid.box
        return through_vertices(box.lower_m, box.upper_m, np.asarray(self.excess_refractivity(air)))


def largest_contrast_k(problem: Problem) -> float | None:
    """The largest stated |T - T0|, of inlets, outlets, heaters, walls, planes and sensors; None where none is."""
    return max((abs(excess) for excess in _stated_excesses_k(problem)), default=None)


def _stated_excesses_k(problem: Problem) -> list[float]:
    stated = [b.temperature_k for b in problem.scene.boundary if isinstance(b, Inlet | Heater)]
    walls = [b.temperature_k for b in problem.scene.boundary if isinstance(b, Wall)]
    stated += [t for t in walls if t is not None]
    stated += [kelvin for *_, kelvin in measured_outlets(problem.scene)]
    stated += [float(t) for plane in problem.planes for t in np.percentile(plane.temperature_k, [0.5, 99.5])]
    stated += [float(t) for sensor in problem.sensors for t in sensor.temperature_k if np.isfinite(t)]
    return [t - problem.scene.air.ambient_temperature_k for t in stated]


def expected_flow(problem: Problem, excess_k: float | None = None) -> ExpectedFlow:
    """What to expect; `excess_k` sets its largest contrast.

    Raises SettingError for a contrast that is not a finite number above 0, or at which air is below 0 K.
    """
    if excess_k is not None and not (np.isfinite(excess_k) and 0 < excess_k < 5000):
        raise SettingError(
            f"The expected contrast is {excess_k:g} K; expected a temperature difference above 0 and below "
            "5000 K, such as 10."
        )
    problem = with_planes_read(problem)
    known = largest_contrast_k(problem)
    if any(isinstance(b, Driving) for b in problem.scene.boundary) and known:
        marched = _marched(problem)
        return marched if excess_k is None else _rescaled(marched, excess_k, known)
    return plume_flow(problem, excess_k)


def plume_flow(problem: Problem, excess_k: float | None = None) -> ExpectedFlow:
    """A plume of the contrast asked for, else of the largest stated, in the middle of the room."""
    known = largest_contrast_k(problem)
    peak_k = excess_k or known or DEFAULT_EXCESS_K
    grid = VertexGrid(problem.scene.room, (_VERTICES, _VERTICES, _VERTICES))
    reason = "asked for" if excess_k else "the largest stated" if known else "assumed: nothing is stated"
    source = f"a plume of {peak_k:.3g} K in the middle of the room ({reason})"
    return ExpectedFlow(grid, _plume_k(problem.scene, grid, peak_k), source)


def _marched(problem: Problem) -> ExpectedFlow:
    scene = problem.scene
    coarse = room(scene, _COARSE.coarse_cells, closure_name(scene))
    shape = (_VERTICES, _VERTICES, _VERTICES)
    prior = room_prior(problem, coarse.layout)
    done = run_as_stated(coarse, prior, problem, _COARSE, shape, Marches())
    excess = _without_layers(np.asarray(done.fields.excess_k, np.float64))
    # A short coarse march may overshoot: the air is no warmer, and no colder, than what drives it.
    stated = [0.0, *_stated_excesses_k(problem)]
    excess = np.clip(excess, min(stated), max(stated))
    model = coarse.model(prior.mean)
    limits = step_limits(MarchSettings().courant, np.inf, steady=True)
    step_s = float(own_pace(done.flow.last, model, limits).own_s.mean())
    solids = model.boundary.solids
    return ExpectedFlow(
        VertexGrid(scene.room, shape),
        excess,
        f"the stated supply and walls, marched for {done.flow.model_s:.0f} s on {_COARSE.coarse_cells} cells an edge",
        step_s,
        min(coarse.grid.spacing_m),
        coarse.turnover_ratio,
        fluctuation(done.flow.mean, coarse.grid, None if solids is None else np.asarray(solids.air) > 0),
    )


def _without_layers(excess_k: Volume) -> Volume:
    """Wall vertices get their neighbours' values: a thermal layer is thinner than a cell and than a window."""
    return np.pad(excess_k[1:-1, 1:-1, 1:-1], 1, mode="edge")


def _rescaled(flow: ExpectedFlow, excess_k: float, known_k: float) -> ExpectedFlow:
    larger, moves = excess_k / known_k, flow.fluctuation
    return replace(
        flow,
        excess_k=flow.excess_k * larger,
        source=f"{flow.source}, scaled to {excess_k:g} K",
        fluctuation=None if moves is None else replace(moves, std_k=larger * moves.std_k),
    )


def _plume_k(scene: Scene, grid: VertexGrid, peak_k: float) -> Volume:
    """A Gaussian plume a fifteenth of the room wide."""
    radius_m = max(min(scene.room.size_m) / 15, max(grid.spacing_m))
    unit = plume(scene.air, peak_k=peak_k, centre_m=scene.room.centre_m, radius_m=radius_m)
    points = np.stack(np.meshgrid(*grid.axes_m, indexing="ij"), -1).reshape(-1, 3)
    values = np.asarray(unit.excess(jnp.asarray(points, jnp.float32)), np.float64).reshape(grid.shape)
    n0, t0 = scene.air.ambient_refractivity, scene.air.ambient_temperature_k
    return n0 * t0 / (n0 + values) - t0
