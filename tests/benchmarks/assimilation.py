"""Assimilation in time: a room marched through a sequence and corrected by each burst, beside what a sequence gives.

    python -m tests.benchmarks.assimilation EXPERIMENT [--information 16] [--members 40] [--cells 24]

EXPERIMENT is simulated with `--snapshots` that hold the velocity, has a sequence of bursts and a result of `airlens
reconstruct EXPERIMENT --preset standard --sequence`. With `--information` not 1 the shifts are computed from the
snapshots by straight rays, with so many times the information of the pictures' windows.

The forecast is `core.room` without a closure on a coarse grid: the limited advection takes the small eddies' part
(implicit large-eddy simulation: Grinstein, Margolin and Rider 2007), since k-epsilon's viscosity leaves no eddies.
Its departures from its own mean are added to the mean room. Members are moments of one free march. The filter is
the local ensemble transform filter (Hunt, Kostelich and Szunyogh, Physica D 230, 2007); the weight of a datum falls
with its distance from the line of sight, by a Gaussian of the length that the sequence's departures were found to
have. Before each burst the members get departures of the free march (Whitaker and Hamill, Mon. Weather Rev. 140,
2012), of the size at which the innovations are as large as expected. `--weights` divides the information, for what
a coarse room cannot show: each is tried.

One JSON line each for the air of the snapshots, the free march, the mean room, each burst alone, and the filter at
each weight. `T_K`, `u_m_s` are rms errors of bursts (u: of a component), `T_departure`, `u_departure` those of the
departures from the sequence's mean over their size, `T_within`, `u_within` the points in 95 % intervals;
`forecast_` before the burst was seen. Of the air, `like_next` is the correlation with the next burst, at the same
place.
"""

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.interpolate import RegularGridInterpolator

from app.experiment.captures import newest_pair
from app.experiment.folder import Experiment, open_experiment
from app.experiment.results import read_result
from app.experiment.rig_settings import SimulatedCameraSettings
from app.reconstruct.measure import measure
from app.reconstruct.problem import known_of, problem_of
from app.volume.snapshots import read_snapshots
from core.estimate.prior import room_prior
from core.metrics import inner
from core.motion import without_motion
from core.problem import ShiftMeasurement
from core.rays.operator import build
from core.rays.visibility import wall_points
from core.result import Solution
from core.room.forward import Room, room, room_fields
from core.room.march import MarchSettings, march
from core.room.room_grid import AXES, Velocity
from core.room.step import Flow, RoomModel
from core.room.wall_planes import set_normal
from core.scene import Scene
from core.significance import EITHER_WAY
from core.solve.sequence.departures import joined, solve_departures

# Vertices on which departures are seen and scored, and points across the wall at which the filter is worked out.
VERTICES, POINTS = (33, 33, 33), (13, 9)
# A jet answers within this time (core.estimate.forward_runs).
RESPONSE_S = 30.0
# A Gaussian weight below this counts nothing.
LEAST_WEIGHT = 0.01

Fields = Float[np.ndarray, "moments vx vy vz ..."]


@dataclass(frozen=True)
class Air:
    """T [K] and u [m/s] at several moments on the room's vertices, and one sigma of both."""

    temperature_k: Fields
    velocity_m_s: Fields
    temperature_std_k: Fields | float = 0.0
    velocity_std_m_s: Fields | float = 0.0

    def departures(self) -> "Air":
        """Less the mean of all moments."""
        of = (self.temperature_k, self.velocity_m_s)
        return Air(*(values - values.mean(axis=0) for values in of))


class Seen:
    """The windows of one view: whitened numbers, and what departures of T would show."""

    def __init__(self, scene: Scene, mean_k: np.ndarray, first: ShiftMeasurement) -> None:
        air = scene.air
        self._slope = -air.ambient_refractivity * air.ambient_temperature_k / mean_k**2
        self._rays = build(scene, 0, first.centres_px, VERTICES, float(first.window_px))
        values, vectors = np.linalg.eigh(first.information_per_px2)
        self._root = (vectors * np.sqrt(values)[:, None, :]) @ vectors.transpose(0, 2, 1)
        errors_px = first.common_errors_px
        self._still = None if errors_px is None else without_motion(errors_px, first.information_per_px2)
        wall_m = np.asarray(wall_points(scene, 0, first.centres_px))
        self.place_m = np.repeat(wall_m[:, [0, 2]], 2, axis=0)

    def shifts_px(self, departures_k: Fields) -> np.ndarray:
        """The shifts of windows [moments, windows, 2]."""
        fields = jnp.asarray(departures_k * self._slope, jnp.float32)
        return np.asarray(eqx.filter_jit(jax.vmap(self._rays.apply))(fields), np.float64)

    def white(self, shifts_px: np.ndarray) -> Float[np.ndarray, "numbers moments"]:
        """The same as numbers of variance 1, without what a motion of the camera explains."""
        still = self._still
        alone = shifts_px if still is None else np.stack([still.apply(one) for one in shifts_px])
        return np.einsum("wab,mwb->wam", self._root, alone).reshape(-1, len(shifts_px))


class Unsteady:
    """A coarse room without closure, marched in real time."""

    def __init__(self, where: Room, model: RoomModel) -> None:
        self.where, self.model = where, model

    def after(self, flow: Flow, seconds: float) -> Flow:
        """The flow after so long, with nothing held or extrapolated."""
        settings = MarchSettings(
            longest_s=seconds, window_s=seconds, tolerance=0.0, level_ahead_s=0.0, steady=False
        )
        return march(flow, self.model, settings).last

    def seen(self, flows: Sequence[Flow]) -> Air:
        """On vertices."""
        fields = [room_fields(flow, self.model, self.where.layout, VERTICES) for flow in flows]
        return Air(
            np.stack([one.excess_k for one in fields]).astype(float),
            np.stack([one.velocity_m_s for one in fields]).astype(float),
        )

    def start(self, mean: Solution, ambient_k: float) -> Flow:
        """The mean room on the cells."""
        grid, own = self.where.grid, (mean.x_m, mean.y_m, mean.z_m)

        def on(values: np.ndarray, faces: int | None) -> jax.Array:
            at = [grid.faces_m(a) if a == faces else grid.centres_m(a) for a in AXES]
            return jnp.asarray(resampled(values, own, at), jnp.float32)

        assert mean.velocity_m_s is not None
        u, v, w = (on(mean.velocity_m_s[..., a], a) for a in AXES)
        excess_k = on(mean.temperature_k - ambient_k, None)
        return Flow(set_normal((u, v, w), self.model.boundary), excess_k, jnp.zeros_like(excess_k), None)


def resampled(values: np.ndarray, own_m: Sequence[np.ndarray], at_m: Sequence[np.ndarray]) -> np.ndarray:
    """Linear, the nearest beyond the ends."""
    clipped = [np.clip(at, axis[0], axis[-1]) for at, axis in zip(at_m, own_m, strict=True)]
    mesh = np.stack(np.meshgrid(*clipped, indexing="ij"), axis=-1)
    return RegularGridInterpolator(own_m, np.asarray(values, float))(mesh)


def transforms(
    shown: np.ndarray, missed: np.ndarray, place_m: np.ndarray, at_m: list[np.ndarray], length_m: float
) -> Float[np.ndarray, "x z members members"]:
    """What makes analysed departures of the members' about their mean, at points across the wall (Hunt 2007, 2.3).

    `shown` are the members' data about their mean, `missed` what their mean leaves, both of noise 1.
    """
    members = shown.shape[1]
    found = np.zeros((*map(len, at_m), members, members))
    for n, x_m in enumerate(at_m[0]):
        for m, z_m in enumerate(at_m[1]):
            weight = np.exp(-0.5 * ((place_m - [x_m, z_m]) ** 2).sum(axis=1) / length_m**2)
            near = weight > LEAST_WEIGHT
            score = shown[near] * weight[near, None]
            values, vectors = np.linalg.eigh((members - 1) * np.eye(members) + shown[near].T @ score)
            mean = vectors @ (vectors.T @ (score.T @ missed[near]) / values)
            found[n, m] = mean[:, None] + (vectors * np.sqrt((members - 1) / values)) @ vectors.T
    return found


def analysed(flows: list[Flow], found: np.ndarray, at_m: list[np.ndarray], room_: Unsteady) -> list[Flow]:
    """The members after a burst; their next step takes the divergence of the velocity out."""
    grid = room_.where.grid

    def mixed(arrays: list[jax.Array], faces: int | None) -> list[jax.Array]:
        x_m, z_m = (np.asarray(grid.faces_m(a) if a == faces else grid.centres_m(a)) for a in (0, 2))
        each = resampled(found, at_m, [x_m, z_m])
        of = np.stack([np.asarray(one) for one in arrays])
        mean = of.mean(axis=0)
        changed = np.einsum("xznk,nxyz->kxyz", each, of - mean, optimize=True)
        return [jnp.asarray(mean + one, jnp.float32) for one in changed]

    excess_k = mixed([flow.excess_k for flow in flows], None)
    u, v, w = (mixed([flow.velocity[a] for flow in flows], a) for a in AXES)
    boundary = room_.model.boundary
    return [
        Flow(set_normal((u[n], v[n], w[n]), boundary), excess_k[n], flow.pressure_m2_s2, None)
        for n, flow in enumerate(flows)
    ]


def stirred(flows: list[Flow], free: list[Flow], size: float, rng: np.random.Generator) -> list[Flow]:
    """The members with departures of the free march, `size` times as large, each once."""
    mean = jax.tree.map(lambda *leaves: sum(leaves) / len(leaves), *free)
    order, signs = rng.permutation(len(flows)), rng.choice([-1.0, 1.0], len(flows))

    def added(flow: Flow, other: Flow, by: float) -> Flow:
        by32 = jnp.float32(by)
        moved = jax.tree.map(lambda own, one, middle: own + by32 * (one - middle), flow, other, mean)
        velocity: Velocity = moved.velocity
        return Flow(velocity, moved.excess_k, flow.pressure_m2_s2, None)

    return [added(flow, free[order[n]], signs[n] * size) for n, flow in enumerate(flows)]


def assimilated(
    free: list[Flow], room_: Unsteady, seen: Seen, data: np.ndarray, time_s: np.ndarray, length_m: float
) -> Iterator[tuple[Air, Air, float]]:
    """For each burst the departures of the forecast and of the analysis, with their spread, and what was stirred.

    `data` are the bursts' numbers, of noise 1.
    """
    box, rng, flows = room_.where.scene.room, np.random.default_rng(0), list(free)
    at_m = [np.linspace(box.lower_m[a], box.upper_m[a], n) for a, n in zip((0, 2), POINTS, strict=True)]
    still = room_.seen(free)
    mean_k, mean_m_s = still.temperature_k.mean(axis=0), still.velocity_m_s.mean(axis=0)
    typical = seen.white(seen.shifts_px(still.temperature_k - mean_k)).var(axis=1, ddof=1).mean()

    def air(of: list[Flow]) -> Air:
        found = room_.seen(of)
        each_k, each_m_s = found.temperature_k - mean_k, found.velocity_m_s - mean_m_s
        return Air(each_k.mean(0), each_m_s.mean(0), each_k.std(0, ddof=1), each_m_s.std(0, ddof=1))

    def shown() -> np.ndarray:
        return seen.white(seen.shifts_px(room_.seen(flows).temperature_k - mean_k))

    for n, burst in enumerate(data.T):
        size = 0.0
        if n > 0:
            flows = [room_.after(flow, float(time_s[n] - time_s[n - 1])) for flow in flows]
            numbers = shown()
            lacking = np.mean((burst - numbers.mean(axis=1)) ** 2) - 1.0 - numbers.var(axis=1, ddof=1).mean()
            size = float(np.clip(lacking / typical, 0.0, 1.0)) ** 0.5
            flows = stirred(flows, free, size, rng)
        before, numbers = air(flows), shown()
        middle = numbers.mean(axis=1)
        found = transforms(numbers - middle[:, None], burst - middle, seen.place_m, at_m, length_m)
        flows = analysed(flows, found, at_m, room_)
        yield before, air(flows), size


def together(airs: Sequence[Air]) -> Air:
    """Moments, one after the other."""
    return Air(*(np.stack([getattr(air, name) for air in airs]) for name in Air.__dataclass_fields__))


def scored(found: Air, mean: Air, truth: Air, begin: str = "") -> dict[str, float]:
    """Departures `found`, added to the mean room, beside the snapshots."""

    def flat(values: np.ndarray) -> np.ndarray:
        return np.stack([inner(one) for one in values])

    row, moved = {}, truth.departures()
    for letter, unit, name in (("T", "K", "temperature"), ("u", "m_s", "velocity")):
        own, middle, true, true_moved = (
            getattr(of, f"{name}_{unit.lower()}") for of in (found, mean, truth, moved)
        )
        std, middle_std = (np.asarray(getattr(of, f"{name}_std_{unit.lower()}")) for of in (found, mean))
        error = flat(middle + own - true)
        sigma = flat(np.broadcast_to(np.hypot(std, middle_std), true.shape))
        row |= {
            f"{begin}{letter}_{unit}": rms(error),
            f"{begin}{letter}_departure": rms(flat(own - true_moved)) / rms(flat(true_moved)),
            f"{begin}{letter}_within": float(np.mean(np.abs(error) <= EITHER_WAY * sigma)),
        }
    return row


def rms(values: np.ndarray) -> float:
    """Of all numbers."""
    return float(np.sqrt(np.mean(np.square(values))))


def true_air(experiment: Experiment, time_s: np.ndarray) -> Air:
    """The snapshots that each burst saw, on the vertices."""
    camera, box = experiment.settings.rig.camera, experiment.settings.scene.room
    if not isinstance(camera, SimulatedCameraSettings) or camera.snapshots is None:
        raise SystemExit("The experiment has no snapshots; simulate it with --snapshots.")
    path = experiment.file(camera.snapshots)
    snapshots = read_snapshots(path, box)
    with np.load(path) as file:
        velocity_m_s = file["u"]
    at = [snapshots.nearest(float(moment)) for moment in time_s]
    own, wanted = (
        axes_m(experiment.settings.scene, n) for n in (snapshots.temperature_k.shape[1:], VERTICES)
    )
    return Air(
        np.stack([resampled(snapshots.temperature_k[n], own, wanted) for n in at]),
        np.stack([resampled(velocity_m_s[n], own, wanted) for n in at]),
    )


def axes_m(scene: Scene, vertices: tuple[int, ...]) -> list[np.ndarray]:
    """Evenly spaced, end planes included."""
    box = scene.room
    return [np.linspace(box.lower_m[a], box.upper_m[a], vertices[a]) for a in AXES]


def mean_air(mean: Solution, scene: Scene) -> Air:
    """The mean room on the vertices."""
    fields = (mean.temperature_k, mean.velocity_m_s, mean.temperature_std_k, mean.velocity_std_m_s)
    if any(one is None for one in fields):
        raise SystemExit(
            "The result has no velocity with deviations; reconstruct with --preset standard --sequence."
        )
    own = (mean.x_m, mean.y_m, mean.z_m)
    return Air(*(resampled(np.asarray(one), own, axes_m(scene, VERTICES))[None] for one in fields))


def told_of_truth(truth: Air) -> dict[str, float | str]:
    """How large the departures are, how like they are one burst later, and what a mean along y leaves of them."""
    row: dict[str, float | str] = {"what": "air"}
    moved = truth.departures()
    for letter, values in (("T", moved.temperature_k), ("u", moved.velocity_m_s)):
        of = np.stack([inner(one) for one in values])
        row |= {
            f"{letter}_rms": rms(of),
            f"{letter}_like_next": float((of[1:] * of[:-1]).mean() / (of**2).mean()),
            f"{letter}_less_mean_along_y": rms(of - of.mean(axis=2, keepdims=True)) / rms(of),
        }
    return row


def computed(seen: Seen, truth: Air, bursts: list[ShiftMeasurement], factor: float) -> list[ShiftMeasurement]:
    """The bursts' shifts from the snapshots, with `factor` times their information."""
    rng, found = np.random.default_rng(0), []
    exact_px = seen.shifts_px(truth.departures().temperature_k)
    for shift_px, burst in zip(exact_px, bursts, strict=True):
        information = factor * burst.information_per_px2
        root = np.linalg.cholesky(information).transpose(0, 2, 1)
        noise_px = np.linalg.solve(root, rng.standard_normal((*shift_px.shape, 1)))[..., 0]
        found.append(replace(burst, displacement_px=shift_px + noise_px, information_per_px2=information))
    return found


def emitted(row: dict[str, float | str]) -> None:
    """One JSON line."""
    rounded = {name: round(v, 4) if isinstance(v, float) else v for name, v in row.items()}
    print(json.dumps(rounded), flush=True)


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("experiment", type=Path)
    parser.add_argument("--information", type=float, default=1.0)
    parser.add_argument("--members", type=int, default=40)
    parser.add_argument("--cells", type=int, default=24)
    parser.add_argument("--apart-s", type=float, default=6.0, help="Between the free march's members.")
    parser.add_argument("--weights", type=float, nargs="+", default=[1.0, 4.0, 16.0])
    asked = parser.parse_args()
    experiment = open_experiment(asked.experiment)
    known, measured = known_of(experiment), measure(newest_pair(experiment), known_of(experiment).scene)
    known, mean = replace(known, scene=measured.scene), read_result(experiment.latest_result() / "result.nc")
    if mean.departures is None or mean.velocity_m_s is None:
        raise SystemExit("The newest result is not of --preset standard --sequence; reconstruct so first.")
    cells = room(known.scene, asked.cells, "molecular")
    prior = room_prior(problem_of(known, measured.shifts), cells.layout)
    unsteady = Unsteady(cells, cells.model(prior.mean))
    bursts = _joined(known.scene, [burst[0] for burst in measured.bursts], cells)
    truth, middle = true_air(experiment, mean.departures.time_s), mean_air(mean, known.scene)
    emitted(told_of_truth(truth))
    if asked.information != 1.0:
        seen = Seen(known.scene, middle.temperature_k[0], bursts[0])
        bursts = computed(seen, truth, bursts, asked.information)
    of = {
        "information": asked.information,
        "members": asked.members,
        "cells": asked.cells,
    }
    for row in rows(Compared(known.scene, mean, truth, bursts), unsteady, asked):
        emitted({"what": row.pop("what"), **of, **row})


@dataclass(frozen=True)
class Compared:
    """A sequence with its mean room, and the air that it was taken of."""

    scene: Scene
    mean: Solution
    truth: Air
    bursts: list[ShiftMeasurement]


def rows(of: Compared, unsteady: Unsteady, asked: argparse.Namespace) -> Iterator[dict[str, float | str]]:
    """The mean room, with the spread of the free march as well, each burst alone, and the filter."""
    middle, truth = mean_air(of.mean, of.scene), of.truth
    still = Air(np.zeros_like(truth.temperature_k), np.zeros_like(truth.velocity_m_s))
    yield {"what": "mean room", **scored(still, middle, truth)}
    began_s = time.process_time()
    free = _free(unsteady, of.mean, asked.members, asked.apart_s)
    marched = unsteady.seen(free)
    marched_s = time.process_time() - began_s
    std_k, std_m_s = (v.std(axis=0, ddof=1)[None] for v in (marched.temperature_k, marched.velocity_m_s))
    spread = replace(still, temperature_std_k=std_k, velocity_std_m_s=std_m_s)
    sizes = {"T_rms": rms(std_k), "u_rms": rms(std_m_s), "cpu_s": marched_s}
    yield {"what": "mean room, spread of the free march", **scored(spread, middle, truth), **sizes}
    assert of.mean.departures is not None
    time_s, length_m = of.mean.departures.time_s, of.mean.departures.field_length_m
    began_s = time.process_time()
    alone = solve_departures(of.scene, of.mean, [(burst,) for burst in of.bursts], time_s)
    own_m, at_m = (of.mean.x_m, of.mean.y_m, of.mean.z_m), axes_m(of.scene, VERTICES)
    each_k = np.stack([resampled(one, own_m, at_m) for one in alone.temperature_k])
    each = Air(each_k, still.velocity_m_s, resampled(alone.temperature_std_k, own_m, at_m)[None])
    took_s = time.process_time() - began_s
    yield {"what": "each burst alone", **scored(each, middle, truth), "cpu_s": took_s}
    shifts_px = np.stack([burst.displacement_px for burst in of.bursts])
    for weight in asked.weights:
        seen = Seen(of.scene, middle.temperature_k[0], _weaker(of.bursts[0], weight))
        data = seen.white(shifts_px)
        data -= data.mean(axis=1, keepdims=True)
        began_s = time.process_time()
        found = list(assimilated(free, unsteady, seen, data, time_s, length_m))
        took_s = marched_s + time.process_time() - began_s
        before, after = together([one[0] for one in found]), together([one[1] for one in found])
        rates = {**scored(after, middle, truth), **scored(before, middle, truth, "forecast_")}
        stirring = float(np.mean([one[2] for one in found[1:]]))
        yield {"what": "assimilated", "divided_by": weight, **rates, "stirred": stirring, "cpu_s": took_s}


def _weaker(shift: ShiftMeasurement, factor: float) -> ShiftMeasurement:
    return replace(shift, information_per_px2=shift.information_per_px2 / factor)


def _joined(scene: Scene, bursts: list[ShiftMeasurement], cells: Room) -> list[ShiftMeasurement]:
    """Squares of about a cell, each with the mean of the bursts' information."""
    first = bursts[0]
    corners_px = first.centres_px[:1] + first.window_px * np.array([[0.0, 0.0], [1.0, 0.0]])
    one_m, other_m = wall_points(scene, 0, corners_px)
    side = max(1, round(float(cells.grid.spacing_m[0] / np.linalg.norm(other_m - one_m))))
    squares = [joined(burst, side) for burst in bursts]
    information = np.mean([burst.information_per_px2 for burst in squares], axis=0)
    return [replace(burst, information_per_px2=information) for burst in squares]


def _free(unsteady: Unsteady, mean: Solution, members: int, apart_s: float) -> list[Flow]:
    """Moments of a free march from the mean room, once its jet has answered to being free."""
    ambient_k = unsteady.where.scene.air.ambient_temperature_k
    flow, found = unsteady.after(unsteady.start(mean, ambient_k), RESPONSE_S), []
    for _ in range(members):
        flow = unsteady.after(flow, apart_s)
        found.append(flow)
    return found


if __name__ == "__main__":
    main()
