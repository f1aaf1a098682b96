"""What measurements say of a fitted room's level, and the temperatures that its last marches are held at.

Parameters leave some of the level, and where walls are unknown of the profile; the correction of T by all data says
how much. A room that is kept there has its jets bent by the right buoyancy. The correction itself stays one of the
room before: it is not asked for twice.
"""

import numpy as np
from jaxtyping import Float

from core.estimate.discrepancy import Correction, temperature_correction
from core.estimate.forward_runs import Derivatives, ForwardRun
from core.estimate.observation import Observations
from core.estimate.prior import Prior
from core.geometry import WALLS, Face, face_of
from core.room.boundary_conditions import RoomLayout
from core.room.room_grid import AXES
from core.room.vertices import RoomFields, cell_matrix

# Air of one temperature departs from nothing, yet images may say otherwise.
_LEAST_DEPARTURE_K = 1e-3


def to_hold_k(
    data: Observations,
    prior: Prior,
    derivatives: Derivatives,
    held: ForwardRun,
    before: ForwardRun,
    layout: RoomLayout,
) -> Float[np.ndarray, " layers"]:
    """Corrected mean excess temperature of the room `before` it was held; `held` says its departures.

    Where walls are unknown that of every layer of cells: then the room's own profile is no better than they.
    """
    free = free_vertices(layout, held.fields.excess_k.shape)
    start = unheld(held.fields, before.fields, data, prior, free)
    change = last_correction(data, prior, derivatives, start).excess_k[:, None, :] * free
    warmer_k = layer_means(start.excess_k + change) - layer_means(held.fields.excess_k)
    faces_m = layout.grid.faces_m(2)
    heights_m = np.linspace(faces_m[0], faces_m[-1], len(warmer_k))
    in_cells_k = np.interp(layout.grid.centres_m(2), heights_m, warmer_k)
    layers_k = np.asarray(held.flow.mean.excess_k, float).mean((0, 1)) + in_cells_k
    return layers_k if prior.unknown_walls() else layers_k.mean(keepdims=True)


def unheld(
    held: RoomFields,
    before: RoomFields,
    data: Observations,
    prior: Prior,
    free: Float[np.ndarray, "vx vy vz"],
) -> RoomFields:
    """A room that was held, at the level (or profile) it had before: a correction is of what the model says."""
    shift_k = layer_means(held.excess_k) - layer_means(before.excess_k)
    if not prior.unknown_walls():
        shift_k = np.full_like(shift_k, shift_k.mean())
    outflow_k, box = held.outflow_excess_k.copy(), data.scene.room
    heights_m = np.linspace(box.lower_m[2], box.upper_m[2], len(shift_k))
    for n, outlet, _ in data.outlets:
        patch, face = outlet.patch, face_of(outlet.patch.wall)
        middle_m = 0.5 * (patch.lower_m[1] + patch.upper_m[1])
        height_m = face.place_m(box) if face.axis == 2 else middle_m
        outflow_k[n] -= float(np.interp(height_m, heights_m, shift_k))
    return RoomFields(held.excess_k - shift_k * free, held.pressure_m2_s2, held.velocity_m_s, outflow_k)


def last_correction(
    data: Observations, prior: Prior, derivatives: Derivatives, fields: RoomFields
) -> Correction:
    """The correction of T by all that parameters leave unexplained."""
    own_k = max(departure(fields.excess_k), _LEAST_DEPARTURE_K)
    level_k = max(own_k, level_std_k(derivatives))
    residual = data.values()[0] - data.predicted(fields)
    return temperature_correction(data, fields.excess_k, residual, own_k, level_k, prior.unknown_walls())


def layer_means(field: Float[np.ndarray, "vx vy vz"]) -> Float[np.ndarray, " vz"]:
    """Mean of a field at each height, side walls left out."""
    return field[1:-1, 1:-1].mean((0, 1))


def free_vertices(layout: RoomLayout, shape: tuple[int, int, int]) -> Float[np.ndarray, "vx vy vz"]:
    """1 where a vertex is not on a wall, or heater, of stated temperature."""
    free = np.ones(shape)
    for wall in np.flatnonzero(layout.held):
        free[_plane(face_of(WALLS[wall]))] = 0.0
    for heater in (h for h, shown in zip(layout.heaters, layout.shown, strict=True) if shown):
        first, second = (cell_matrix(layout.grid, a, shape[a]) for a in AXES if a != heater.axis)
        free[_plane(face_of(WALLS[heater.wall]))] *= 1.0 - first @ np.pad(heater.fraction, 1) @ second.T
    return free


def _plane(face: Face) -> tuple[slice | int, ...]:
    return tuple(face.end if a == face.axis else slice(None) for a in AXES)


def level_std_k(derivatives: Derivatives) -> float:
    """How far what was stated leaves the level open: a room's temperature balances what nobody knows exactly."""
    return float(np.linalg.norm(derivatives.per_deviation(lambda run: run.excess_k.mean())))


def departure(field: Float[np.ndarray, "vx vy vz"]) -> float:
    """Rms of a field's departure from its profile of height, walls left out."""
    field = field[1:-1, 1:-1, 1:-1]
    return float(np.sqrt(np.mean((field - field.mean((0, 1))) ** 2)))
