"""The temperature of every burst of a sequence, as its departure from the sequence's mean.

The pattern moves from the mean picture to a burst's by d = A (s t) + noise: t [K] is the departure, s the slope of
the refractivity at the mean temperature, A the straight rays through the room. All bursts share these. The departures
are taken from one isotropic turbulent field (`modes.py`); its size, its length and the pictures' noise are those that
make the bursts likeliest (`likelihood.py`). The posterior is exact, and its deviation is the same for every burst.

One view sees a mean of t along its rays, in which air far from the wall counts more. Where along them a departure
stands, nothing tells, so it is spread, and the deviation says so. Cost: one product with A for each of _MODES cosines
a sequence; then little a burst.
"""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.interpolate import RegularGridInterpolator

from core.air import Air
from core.known_temperature import VertexGrid
from core.motion import without_motion
from core.problem import ShiftMeasurement
from core.rays.operator import StraightRayOperator, build
from core.rays.visibility import wall_points
from core.result import Departures, Solution
from core.scene import Scene
from core.setting import SettingError
from core.solve.sequence.likelihood import ModesPosterior, SeenModes, likeliest
from core.solve.sequence.modes import Axes, Modes, longest
from core.watch import Watch

LEAST_BURSTS = 3

# Enough for lengths down to some 5 % of a room's longest edge.
_MODES = 1000
# Modes whose shifts are computed at once.
_BATCH = 50
# Windows are joined in squares, so many to the shortest wave: finer ones would show what no mode holds.
_SQUARES = 4
# Vertices at which the deviation is worked out; between them it is linear.
_VERTICES = 9000


def solve_departures(
    scene: Scene,
    mean: Solution,
    bursts: Sequence[tuple[ShiftMeasurement, ...]],
    time_s: Float[np.ndarray, " bursts"],
    watch: Watch = Watch(),
) -> Departures:
    """T of every burst less that of their mean, on the vertices of `mean`.

    `bursts` holds, for each burst and view, how the pattern moved from the mean picture, with the information of the
    burst alone; `time_s` when each began. Raises SettingError for fewer than LEAST_BURSTS; StoppedError.
    """
    if len(bursts) < LEAST_BURSTS:
        raise SettingError(
            f"The sequence has {len(bursts)} bursts; expected at least {LEAST_BURSTS} to tell how they differ. "
            "Take more: airlens capture flow --bursts"
        )
    modes = longest(scene.room, _MODES)
    slope = _slope_per_k(scene.air, mean, modes.grid)
    seen = _seen(scene, 0, modes, slope, [burst[0] for burst in bursts], watch)
    for view in range(1, len(scene.views)):
        seen = seen.and_(_seen(scene, view, modes, slope, [burst[view] for burst in bursts], watch))
    watch.tell({"doing": "find how large and how wide the departures are", "share": 0.7})
    watch.check_stop()
    found = likeliest(modes, seen, _spread_k(mean))
    watch.tell({"doing": "tell how sure the departures are", "share": 0.9})
    watch.check_stop()
    axes_m = (mean.x_m, mean.y_m, mean.z_m)
    return Departures(
        time_s=np.asarray(time_s, np.float64),
        temperature_k=np.stack([modes.sum(one, axes_m) for one in found.weights.T]).astype(np.float32),
        temperature_std_k=_deviation(modes, found, axes_m).astype(np.float32),
        field_std_k=found.std_k,
        field_length_m=found.length_m,
    )


def _seen(
    scene: Scene,
    view: int,
    modes: Modes,
    slope_per_k: Float[np.ndarray, "nx ny nz"],
    bursts: Sequence[ShiftMeasurement],
    watch: Watch,
) -> SeenModes:
    """What one view's windows say of the modes."""
    side = _side(scene, view, modes, bursts[0])
    bursts = [joined(burst, side) for burst in bursts]
    first = bursts[0]
    rays = build(scene, view, first.centres_px, modes.grid.shape, float(first.window_px))
    white = _Whitened(first, np.mean([burst.information_per_px2 for burst in bursts], axis=0))
    data = np.stack([white(burst.displacement_px) for burst in bursts], axis=1)
    # The mean picture has noise of its own, which all bursts share.
    data -= data.mean(axis=1, keepdims=True)
    columns = np.empty((data.shape[0], modes.count), np.float32)
    for start in range(0, modes.count, _BATCH):
        watch.check_stop()
        watch.tell(
            {"doing": "see how waves of the air would move the pattern", "share": 0.7 * start / modes.count}
        )
        some = modes.some(start, start + _BATCH)
        shifts_px = _shifts(rays, some.fields(modes.grid.axes_m) * slope_per_k)
        columns[:, start : start + some.count] = np.stack([white(one) for one in shifts_px], axis=1)
    return SeenModes(
        (columns.T @ columns).astype(np.float64),
        columns.T.astype(np.float64) @ data,
        float((data**2).sum()),
        data.shape[0],
    )


class _Whitened:
    """Shifts of windows as numbers of variance 1, without what a motion of the camera explains."""

    def __init__(
        self, shift: ShiftMeasurement, information_per_px2: Float[np.ndarray, "windows 2 2"]
    ) -> None:
        values, vectors = np.linalg.eigh(information_per_px2)
        self._root = (vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ vectors.transpose(0, 2, 1)
        errors_px = shift.common_errors_px
        self._still = None if errors_px is None else without_motion(errors_px, information_per_px2)

    def __call__(self, shifts_px: Float[np.ndarray, "windows 2"]) -> Float[np.ndarray, " numbers"]:
        alone = shifts_px if self._still is None else self._still.apply(shifts_px)
        return np.einsum("wab,wb->wa", self._root, alone).ravel()


def _shifts(
    rays: StraightRayOperator, fields: Float[np.ndarray, "modes nx ny nz"]
) -> Float[np.ndarray, "modes windows 2"]:
    return np.asarray(_applied(rays, jnp.asarray(fields, jnp.float32)), np.float64)


@eqx.filter_jit
def _applied(rays: StraightRayOperator, fields: jax.Array) -> jax.Array:
    return jax.vmap(rays.apply)(fields)


def _side(scene: Scene, view: int, modes: Modes, shift: ShiftMeasurement) -> int:
    """How many windows a square has along its side."""
    wave_m = 2.0 * np.pi / modes.finest_per_m
    corner_px = shift.centres_px[:1] + shift.window_px * np.array([[0.0, 0.0], [1.0, 0.0]])
    first_m, second_m = wall_points(scene, view, corner_px)
    return max(1, int(wave_m / _SQUARES / np.linalg.norm(second_m - first_m)))


def joined(shift: ShiftMeasurement, side: int) -> ShiftMeasurement:
    """The same by squares of `side` windows: what their windows say together, at their common centre."""
    if side == 1:
        return shift
    width_px = side * shift.window_px
    square = np.floor((shift.centres_px - shift.centres_px.min(axis=0)) / width_px + 1e-6).astype(int)
    _, which = np.unique(square, axis=0, return_inverse=True)
    which = which.ravel()

    def total(values: np.ndarray) -> np.ndarray:
        out = np.zeros((which.max() + 1, *values.shape[1:]))
        np.add.at(out, which, values)
        return out

    information = total(shift.information_per_px2)
    score = total(np.einsum("wab,wb->wa", shift.information_per_px2, shift.displacement_px))
    centres = total(shift.centres_px) / total(np.ones(len(which)))[:, None]
    return ShiftMeasurement(
        centres,
        np.linalg.solve(information, score[..., None])[..., 0],
        information,
        width_px,
        motion=shift.motion,
    )


def _slope_per_k(air: Air, mean: Solution, grid: VertexGrid) -> Float[np.ndarray, "nx ny nz"]:
    """How the refractivity changes with the temperature at the mean: -N0 T0 / T^2."""
    kelvin = _on(mean.filled().temperature_k, (mean.x_m, mean.y_m, mean.z_m), grid.axes_m)
    return -air.ambient_refractivity * air.ambient_temperature_k / kelvin**2


def _spread_k(mean: Solution) -> float:
    """How far T lies from its mean over the room, rms, with its own deviation; a thousandth of a kelvin at least."""
    kelvin, std_k = mean.temperature_k[mean.air], mean.temperature_std_k
    unknown = 0.0 if std_k is None else float(np.mean(std_k[mean.air] ** 2))
    return max((float(np.var(kelvin)) + unknown) ** 0.5, 1e-3)


def _deviation(modes: Modes, found: ModesPosterior, axes_m: Axes) -> Float[np.ndarray, "nx ny nz"]:
    """One sigma of a departure on vertices."""
    share = (_VERTICES / np.prod([len(axis) for axis in axes_m])) ** (1 / 3)
    coarse = [np.linspace(axis[0], axis[-1], max(2, int(min(share, 1.0) * len(axis)))) for axis in axes_m]
    x, y, z = coarse
    slabs = [
        np.square(modes.fields((x[i : i + 1], y, z)).reshape(modes.count, -1).T @ found.root).sum(axis=1)
        for i in range(len(x))
    ]
    return np.sqrt(_on(np.stack(slabs).reshape(len(x), len(y), len(z)), (x, y, z), axes_m))


def _on(values: np.ndarray, axes_m: Axes, at_m: Sequence[np.ndarray]) -> np.ndarray:
    """Values of one set of vertices on another: linear, the nearest beyond the ends."""
    points = [np.clip(at, axis[0], axis[-1]) for at, axis in zip(at_m, axes_m, strict=True)]
    mesh = np.stack(np.meshgrid(*points, indexing="ij"), axis=-1)
    return RegularGridInterpolator(axes_m, np.asarray(values, np.float64))(mesh)
