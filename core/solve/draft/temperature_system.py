"""The quadratic problem of `draft` in the excess refractivity n, flattened: its Hessian and a preconditioner.

Conjugate gradients cost two operator products an iteration; the preconditioner is the prior and the mean data term,
which are diagonal under the cosine transform.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from scipy.fft import dct, dctn, idctn

from core.geometry import face_of
from core.known_temperature import KnownTemperature, VertexGrid
from core.motion import WithoutMotion, without_motion
from core.problem import ShiftMeasurement
from core.scene import Scene
from core.solve.draft.conjugate_gradients import Product
from core.view_frame import facing, looked_along, turn_to

Volume = Float[np.ndarray, "nx ny nz"]
# The steepest slopes of rays along an axis: against x, y and z.
Slopes = dict[int, list[float]]


@runtime_checkable
class ShiftOperator(Protocol):
    """The linear map from excess refractivity on vertices to displacements, and its transpose."""

    def apply(self, values: Volume) -> Float[np.ndarray, "windows 2"]:
        """Displacement [px] of every window."""
        ...

    def transpose(self, displacement_px: Float[np.ndarray, "windows 2"]) -> Volume:
        """The transposed map."""
        ...


@dataclass(frozen=True)
class AirPart:
    """Air that varies slowly along the axis that a view looks along: what n costs at a vertex, and its steps.

    `stiffness` is the weight of the square of a step from one vertex to the next, along x, y and z.
    """

    mass: float
    stiffness: tuple[float, float, float]


@dataclass(frozen=True)
class System:
    """The quadratic problem in n, flattened."""

    grid: VertexGrid
    operators: tuple[ShiftOperator, ...]
    # The axis of the room that each looks along.
    looks_along: tuple[int, ...]
    # The same before the camera's motion is taken out, which the preconditioner does not know.
    rays: tuple[ShiftOperator, ...]
    weights: tuple[Float[np.ndarray, "_ 2 2"], ...]
    known: KnownTemperature
    per_k: float
    # n is the sum of these, which are independent: one for each axis that a view looks along.
    parts: tuple[AirPart, ...]
    slopes: Slopes
    # How much a step of the profile over height, from one level to the next, weighs.
    profile: float

    def with_fewer_data(self, times: float) -> "System":
        """The same with windows that count `times` fewer."""
        return replace(self, weights=tuple(weight / times for weight in self.weights))

    @cached_property
    def precision(self) -> Volume:
        """What the prior weighs on each wave of the cosine transform along x, y and z."""
        x, y, z = (_curvatures(count) for count in self.grid.shape)
        return self.precision_of(x, y, z)

    def precision_of(
        self, x: Float[np.ndarray, " nx"], y: Float[np.ndarray, " ny"], z: Float[np.ndarray, " nz"]
    ) -> Volume:
        """The same of waves with these second differences; the first along x and y are even."""
        variance = np.zeros((len(x), len(y), len(z)))
        for part in self.parts:
            fx, fy, fz = part.stiffness
            variance += 1 / (part.mass + fx * x[:, None, None] + fy * y[None, :, None] + fz * z[None, None])
        precision = 1 / variance
        precision[0, 0] = self.profile / (len(x) * len(y)) * z
        return precision

    def smooth(self, n: Volume) -> Volume:
        """Gradient of the prior's terms: size and smoothness, of departures from a profile that is free."""
        return np.asarray(idctn(self.precision * dctn(n, norm="ortho"), norm="ortho"))

    def joint_stiffness(self, axis: int) -> float:
        """What the parts together weigh on steep steps along an axis."""
        return 1 / sum(1 / part.stiffness[axis] for part in self.parts)

    def known_terms(self, n: Volume) -> Volume:
        """Hessian of the known values and means, times n."""
        total = np.zeros_like(n)
        mask = self.known.mask
        total[mask] = n[mask] / (self.known.std_k[mask] * self.per_k) ** 2
        flat = total.reshape(-1)
        for members, _, std in self.known.means:
            flat[members] += n.reshape(-1)[members].mean() / (len(members) * (std * self.per_k) ** 2)
        return total

    def data_terms(self, n: Volume) -> Volume:
        """Hessian of the data, times n."""
        total = np.zeros_like(n)
        for operator, weight in zip(self.operators, self.weights, strict=True):
            total += operator.transpose(np.einsum("wab,wb->wa", weight, operator.apply(n)))
        return total


@dataclass(frozen=True)
class StillOperator:
    """A `ShiftOperator` without what a motion of the camera explains."""

    rays: ShiftOperator
    still: WithoutMotion

    def apply(self, values: Volume) -> Float[np.ndarray, "windows 2"]:
        """Displacement [px] of every window."""
        return self.still.apply(self.rays.apply(values))

    def transpose(self, displacement_px: Float[np.ndarray, "windows 2"]) -> Volume:
        """The transposed map."""
        return self.rays.transpose(self.still.transpose(displacement_px))


def without_shared_errors(
    operator: ShiftOperator,
    shift: ShiftMeasurement,
    weight: Float[np.ndarray, "windows 2 2"],
    layers_px: Float[np.ndarray, "windows 2 errors"],
) -> tuple[ShiftOperator, ShiftMeasurement]:
    """The operator and the shifts without what windows share: the camera's motion, and layers on the wall before it.

    For windows of this weight.
    """
    errors_px = layers_px
    if shift.common_errors_px is not None:
        errors_px = np.concatenate([shift.common_errors_px, layers_px], axis=-1)
    if errors_px.shape[-1] == 0:
        return operator, shift
    still = without_motion(errors_px, weight)
    return StillOperator(operator, still), replace(shift, displacement_px=still.apply(shift.displacement_px))


def preconditioner(system: System) -> Product:
    """Inverse of a separable stand-in: eigenvectors along x and z, a dense system along y.

    The stand-in of views along y is data = (Lx / hx^2 + Lz / hz^2) (x) W, with the levers W of the slabs measured on
    the operators themselves. Rays of a perspective view cross a wave at other phases from slab to slab, by up
    to their slope: the mean over the slopes makes a sinc of W's off-diagonals. Of views along x or z only the
    diagonal of W in the modes counts. Known planes pin their wall.
    """
    shape, spacing = system.grid.shape, system.grid.spacing_m
    (lx, qx, dx), (lz, qz, dz) = (_modes(system, axis) for axis in (0, 2))
    levers = _slab_levers(system, 1)
    across = dx[:, None] / spacing[0] ** 2 + dz[None] / spacing[2] ** 2
    waves = np.asarray(dct(np.eye(shape[1]), axis=0, norm="ortho"))
    precision = system.precision_of(lx, _curvatures(shape[1]), lz).transpose(0, 2, 1)
    matrices = (
        (waves.T * precision[..., None, :]) @ waves
        + _mean_mass(system) * np.eye(shape[1])
        + across[..., None, None] * levers * _coherence(system)
    )
    for axis in {0, 2} & set(system.looks_along):
        beside = 2 - axis
        curvature = (dx[:, None], dz[None])[beside // 2] / spacing[beside] ** 2
        seen = _levers_of_modes(system, axis, qx if axis == 0 else qz)
        matrices += (seen * curvature)[..., None, None] * np.eye(shape[1])
        matrices += seen[..., None, None] * _laplacian(shape[1]) / spacing[1] ** 2
    inverses = np.linalg.inv(matrices)

    across_x, across_z = np.ascontiguousarray(qx.T), np.ascontiguousarray(qz.T)

    def apply(n: Volume) -> Volume:
        # Slab by slab: products so small stay in this thread.
        modes = (across_x @ n.transpose(1, 0, 2) @ qz).transpose(1, 2, 0)
        modes = (inverses @ modes[..., None])[..., 0]
        return np.ascontiguousarray((qx @ modes.transpose(2, 0, 1) @ across_z).transpose(1, 0, 2))

    return apply


def _curvatures(count: int) -> Float[np.ndarray, " waves"]:
    """Second differences of each wave of the cosine transform along a line with free ends, over the wave itself."""
    return np.asarray(2.0 - 2.0 * np.cos(np.pi * np.arange(count) / count))


def _mean_mass(system: System) -> float:
    """What the known means weigh on a uniform departure, a vertex: nothing else may hold the level."""
    weights = [1 / (std * system.per_k) ** 2 for _, _, std in system.known.means]
    return float(sum(weights)) / int(np.prod(system.grid.shape))


def _coherence(system: System) -> Float[np.ndarray, "nx nz ny ny"]:
    """Mean over the slopes of views along y of the phase between two slabs, for each pair of waves along x and z."""
    along_x, along_z = (_phases(system, 1, axis) for axis in (0, 2))
    return along_x[:, None] * along_z[None]


def _phases(system: System, along: int, across: int) -> Float[np.ndarray, "waves n n"]:
    """Mean over the slopes of views along one axis of the phase between two slabs, for each wave along another."""
    places_m = system.grid.axes_m[along]
    apart_m = places_m[:, None] - places_m[None]
    waves_per_m = np.arange(system.grid.shape[across]) / (2 * system.grid.box.size_m[across])
    slope = system.slopes[along][across] if along in system.slopes else 0.0
    return np.sinc(2 * waves_per_m[:, None, None] * slope * apart_m)


def _levers_of_modes(
    system: System, axis: int, vectors: Float[np.ndarray, "n n"]
) -> Float[np.ndarray, "nx nz"]:
    """What views along x (or z) weigh on each mode along it, for each wave along the other of the two."""
    levers = _slab_levers(system, axis) * _phases(system, axis, 2 - axis)
    weights = np.einsum("ai,wab,bi->iw", vectors, levers, vectors, optimize=True)
    return weights if axis == 0 else weights.T


def steepest_slopes(scene: Scene) -> Slopes:
    """Largest slope of a camera ray that meets its wall, by the axis that it looks along and the one across."""
    steepest = {axis: [0.0, 0.0, 0.0] for axis in looked_along(scene)}
    for number, view in enumerate(scene.views):
        turn, along = turn_to(view.wall), face_of(view.wall).axis
        own, place = facing(scene, number)
        camera_m, room = own.views[place].camera.position_m, own.room
        for axis in (0, 2):
            for end in (room.lower_m[axis], room.upper_m[axis]):
                slope = abs(end - camera_m[axis]) / (room.upper_m[1] - camera_m[1])
                of = steepest[along]
                of[turn.axes[axis]] = max(of[turn.axes[axis]], slope)
    return steepest


def _laplacian(n: int) -> Float[np.ndarray, "n n"]:
    """Second differences of a line with free ends, positive."""
    laplacian = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    laplacian[0, 0] = laplacian[-1, -1] = 1.0
    return laplacian


def _modes(
    system: System, axis: int
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n"], Float[np.ndarray, " n"]]:
    """Modes along an axis whose known end planes are pinned: smoothness, vectors, unpinned curvature."""
    laplacian = _laplacian(system.grid.shape[axis])
    pinned = laplacian.copy()
    mask, std = (np.moveaxis(v, axis, 0) for v in (system.known.mask, system.known.std_k))
    for end in (0, -1):
        if mask[end].mean() > 0.5:
            weight = np.mean(1 / (std[end][mask[end]] * system.per_k) ** 2)
            pinned[end, end] += weight / system.joint_stiffness(axis)
    values, vectors = np.linalg.eigh(pinned)
    return values, vectors, np.einsum("ai,ab,bi->i", vectors, laplacian, vectors)


def _slab_levers(system: System, axis: int) -> Float[np.ndarray, "n n"]:
    """Hessian of the data of views along an axis for a unit gradient across it, slab by slab, a vertex."""
    shape, spacing = system.grid.shape, system.grid.spacing_m
    count, rising = shape[axis], 1 if axis == 0 else 0
    total = np.zeros((count, count))
    ramp = np.moveaxis(np.arange(shape[rising]) * spacing[rising] * np.ones((1, 1, 1)), 2, rising)
    for along, operator, weight in zip(system.looks_along, system.rays, system.weights, strict=True):
        if along != axis:
            continue
        shifts = []
        for j in range(count):
            slab = np.zeros(shape)
            here = tuple(slice(j, j + 1) if a == axis else slice(None) for a in range(3))
            slab[here] = ramp
            shifts.append(operator.apply(slab))
        stacked = np.stack(shifts)
        total += np.einsum("iwa,wab,jwb->ij", stacked, weight, stacked, optimize=True)
    return total / (np.prod(shape) / count)
