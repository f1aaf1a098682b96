"""A found flow as volume a second through the faces of cells, with no divergence left in any of them.

The cells lie between the solution's vertices, and a face takes the mean of its four corners. A found flow is
interpolated, so a little is missing in every cell; the least change that mends it is a gradient:

    q <- q + area / spacing (phi_this - phi_next),     sum of q over each cell's faces = 0

phi comes from the cosine basis, as in `core.room.pressure`. Wall faces keep their flow, after all that leaves was
scaled to all that enters.
"""

from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Float
from scipy import fft

from core.geometry import WALLS, Face, face_of
from core.result import Solution
from core.scene import Patch
from core.setting import SettingError

Vertices = Float[np.ndarray, "_ _ _"]
Cells = Float[np.ndarray, "nx ny nz"]
Faces = Float[np.ndarray, "_ _ _"]
Axis = Float[np.ndarray, " _"]
Triple = tuple[Faces, Faces, Faces]
Values = Float[np.ndarray, "..."]

# A flow that changes the room's air less than once in this time is taken for none.
SLOWEST_S = 1e7


class FaceFlow(eqx.Module):
    """Flow [m3/s] along each axis through the faces normal to it, both walls included; one longer than the cells."""

    axes_m: tuple[Axis, Axis, Axis]
    flow_m3_s: tuple[Faces, Faces, Faces]

    @property
    def cells(self) -> tuple[int, int, int]:
        """Cells along x, y, z."""
        nx, ny, nz = (len(axis) - 1 for axis in self.axes_m)
        return nx, ny, nz

    @property
    def volumes_m3(self) -> Cells:
        """Volume of each cell."""
        x, y, z = (np.diff(axis) for axis in self.axes_m)
        return x[:, None, None] * y[:, None] * z

    @property
    def speed_m_s(self) -> Cells:
        """Speed of the mean flow in each cell."""
        areas = [self.volumes_m3[0, 0, 0] / (axis[1] - axis[0]) for axis in self.axes_m]
        parts = [corner_mean(q, (a,)) / areas[a] for a, q in enumerate(self.flow_m3_s)]
        return np.linalg.norm(np.stack(parts), axis=0)

    @property
    def entering_m3_s(self) -> float:
        """All air that enters the room; as much leaves."""
        return float(sum(np.maximum(self.inward(face_of(wall)), 0.0).sum() for wall in WALLS))

    def inward(self, face: Face) -> Float[np.ndarray, "first second"]:
        """Flow into the room through each face of a wall."""
        return face.inward * np.take(self.flow_m3_s[face.axis], face.end, axis=face.axis)


def face_flow(solution: Solution, openings: Sequence[Patch] = (), cells: int | None = None) -> FaceFlow:
    """The solution's flow, conserved, through the faces between its vertices, or on at most so many `cells` an axis.

    Raises SettingError as `found_flow` does.
    """
    return conserved(found_flow(solution, openings), cells)


def found_flow(solution: Solution, openings: Sequence[Patch] = ()) -> FaceFlow:
    """What passes the faces between the solution's vertices as it was found; as much leaves the room as enters it.

    Air passes walls within a cell around `openings`, and anywhere where there are none. Raises SettingError for a
    solution without velocity, or with none through its walls.
    """
    if solution.velocity_m_s is None:
        raise SettingError("This result has no velocity. Solve with a preset that finds it: standard.")
    axes = _axes(solution)
    x, y, z = (_through_faces(axes, solution.velocity_m_s[..., a], a) for a in range(3))
    for wall in WALLS:
        face = face_of(wall)
        (x, y, z)[face.axis][_plane(face)] *= _open(axes, face, openings)
    return FaceFlow(axes, _balanced((x, y, z), axes))


def conserved(found: FaceFlow, cells: int | None = None) -> FaceFlow:
    """The flow after the least change of inner faces with which every cell passes on what it gets.

    On at most so many `cells` an axis; what passes their faces is exact.
    """
    return _conserved(found if cells is None else _coarser(found, cells))


def _coarser(flow: FaceFlow, cells: int) -> FaceFlow:
    """The same flow through larger faces: what passes each of them is exact."""
    x, y, z = (np.linspace(a[0], a[-1], min(cells, len(a) - 1) + 1) for a in flow.axes_m)
    made = []
    for normal, fine in enumerate(flow.flow_m3_s):
        for a, (old, new) in enumerate(zip(flow.axes_m, (x, y, z), strict=True)):
            turned = np.moveaxis(fine, a, -1)
            turned = _along(old, new, turned) if a == normal else _summed(old, new, turned)
            fine = np.moveaxis(turned, -1, a)
        made.append(fine)
    return FaceFlow((x, y, z), (made[0], made[1], made[2]))


def corner_mean(values: Values, axes: Sequence[int] = (0, 1, 2)) -> Values:
    """Mean of neighbouring vertices along these axes: cells, or faces."""
    for a in axes:
        before = (slice(None),) * a
        values = 0.5 * (values[(*before, slice(None, -1))] + values[(*before, slice(1, None))])
    return values


def _axes(solution: Solution) -> tuple[Axis, Axis, Axis]:
    """The vertices in float64. Raises SettingError where they are not even."""
    x, y, z = (np.asarray(axis, np.float64) for axis in (solution.x_m, solution.y_m, solution.z_m))
    for name, axis in zip("xyz", (x, y, z), strict=True):
        steps = np.diff(axis)
        if np.ptp(steps) > 1e-3 * steps.mean():
            raise SettingError(f"The vertices along {name} are not evenly spaced. Resample the result.")
    even = (np.linspace(axis[0], axis[-1], len(axis)) for axis in (x, y, z))
    return next(even), next(even), next(even)


def _through_faces(axes: tuple[Axis, Axis, Axis], component: Vertices, normal: int) -> Faces:
    others = [a for a in range(3) if a != normal]
    area = np.prod([axes[a][1] - axes[a][0] for a in others])
    return area * corner_mean(np.asarray(component, np.float64), others)


def _plane(face: Face) -> tuple[slice | int, ...]:
    return tuple(face.end if a == face.axis else slice(None) for a in range(3))


def _open(axes: tuple[Axis, Axis, Axis], face: Face, openings: Sequence[Patch]) -> np.ndarray:
    """Which faces of a wall may let air through."""
    first, second = (axes[a] for a in face.along)
    if not openings:
        return np.ones((len(first) - 1, len(second) - 1), bool)
    spans = [around(patch, first, second) for patch in openings if face_of(patch.wall) == face]
    return np.any(spans, axis=0) if spans else np.zeros((len(first) - 1, len(second) - 1), bool)


def around(patch: Patch, first: Axis, second: Axis) -> np.ndarray:
    """Which faces of its wall touch a patch or lie within a cell of it."""
    sides = []
    for axis, low, high in zip((first, second), patch.lower_m, patch.upper_m, strict=True):
        step = axis[1] - axis[0]
        sides.append((axis[1:] > low - 1.001 * step) & (axis[:-1] < high + 1.001 * step))
    return np.outer(*sides)


def _balanced(found: Triple, axes: tuple[Axis, Axis, Axis]) -> Triple:
    """Wall faces with all that leaves scaled to all that enters. Raises SettingError where nothing does."""
    planes = [(face_of(wall), found[face_of(wall).axis][_plane(face_of(wall))]) for wall in WALLS]
    entering, leaving = (
        sum(np.maximum(sign * face.inward * plane, 0.0).sum() for face, plane in planes) for sign in (1, -1)
    )
    volume_m3 = np.prod([axis[-1] - axis[0] for axis in axes])
    if min(entering, leaving) * SLOWEST_S < volume_m3:
        raise SettingError(
            f"The found flow brings {entering:.3g} m3/s into the room and takes {leaving:.3g} m3/s out of it: "
            "there is no age of the air. State the room's inlets and outlets."
        )
    for face, plane in planes:
        plane[face.inward * plane < 0] *= entering / leaving
    return found


def _conserved(flow: FaceFlow) -> FaceFlow:
    """The least change of inner faces after which every cell keeps what it gets."""
    found = [np.array(q) for q in flow.flow_m3_s]
    steps = [axis[1] - axis[0] for axis in flow.axes_m]
    volume = np.prod(steps)
    excess = np.diff(found[0], axis=0) + np.diff(found[1], axis=1) + np.diff(found[2], axis=2)
    eigenvalues = [
        volume / step**2 * (2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n))
        for n, step in zip(excess.shape, steps, strict=True)
    ]
    total = eigenvalues[0][:, None, None] + eigenvalues[1][:, None] + eigenvalues[2]
    total[0, 0, 0] = np.inf
    potential = np.asarray(fft.idctn(fft.dctn(-excess, norm="ortho") / total, norm="ortho"))
    for a, q in enumerate(found):
        inner = tuple(slice(1, -1) if b == a else slice(None) for b in range(3))
        q[inner] -= volume / steps[a] ** 2 * np.diff(potential, axis=a)
    return FaceFlow(flow.axes_m, (found[0], found[1], found[2]))


def _along(old: Axis, new: Axis, values: np.ndarray) -> np.ndarray:
    """Flow normal to planes at `new` of the last axis: within a cell it changes evenly."""
    place = np.interp(new, old, np.arange(len(old)))
    below = np.minimum(place.astype(int), len(old) - 2)
    share = place - below
    return values[..., below] * (1.0 - share) + values[..., below + 1] * share


def _summed(old: Axis, new: Axis, values: np.ndarray) -> np.ndarray:
    """Flow through larger faces of the last axis: over a face it is even."""
    total = np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(values, axis=-1)], axis=-1)
    return np.diff(_along(old, new, total), axis=-1)
