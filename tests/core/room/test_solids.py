import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from core.geometry import Box, looking_along_y
from core.objects import RoomObject
from core.room.boundary_conditions import RoomParameters
from core.room.forward import Room, room
from core.room.obstructed import ObstructedSolver, project_obstructed
from core.room.pace import Pace
from core.room.pressure import divergence_per_s
from core.room.step import Flow, RoomModel, two_steps
from core.scene import FixedTexture, Inlet, Outlet, Patch, Scene, View, Wall
from core.setting import SettingError

BODY = RoomObject(
    name="body", lower_m=(0.8, 0.8, 0.0), upper_m=(1.2, 1.2, 1.2), thermal="power", power_w=60.0
)


@eqx.filter_jit
def advanced(flow: Flow, model: RoomModel) -> Flow:
    """Two steps of 0.05 s in every cell."""
    return two_steps(flow, model, Pace(jnp.float32(0.05), jnp.ones(model.grid.cells), jnp.float32(0.0)))


DESK = RoomObject(name="desk", lower_m=(1.4, 0.6, 0.0), upper_m=(1.8, 1.4, 0.6))


def scene(*objects: RoomObject) -> Scene:
    """A box of 2 m with a supply and an outlet on x_min."""
    camera = looking_along_y(position_m=(1.0, -8.0, 1.0), width_px=64, height_px=64, focal_px=200.0)
    return Scene(
        room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=(2.0, 2.0, 2.0)),
        views=(View(camera=camera),),
        light=FixedTexture(),
        boundary=(
            Inlet(
                patch=Patch(wall="x_min", lower_m=(0.6, 0.2), upper_m=(1.4, 0.6)),
                temperature_k=291.15,
                velocity_m_s=(0.2, 0.0, 0.0),
            ),
            Outlet(patch=Patch(wall="x_min", lower_m=(0.6, 1.4), upper_m=(1.4, 1.8))),
            Wall(wall="y_max", thermal="adiabatic"),
        ),
        objects=objects,
    )


def parameters(of: Room, power_w: float, heat_m_s: float = 0.0) -> RoomParameters:
    count = len(of.layout.objects)
    return RoomParameters(
        jnp.array([-2.0]),
        jnp.zeros(1),
        jnp.float32(0.0),
        jnp.zeros(6),
        jnp.full(6, np.log(max(heat_m_s, 1e-12))),
        jnp.zeros(0),
        jnp.zeros(0),
        jnp.float32(0.0),
        jnp.zeros((3, 3, 4)),
        jnp.full(count, power_w),
        jnp.zeros(count),
        jnp.full(count, np.log(2.5e-3)),
    )


def test_no_air_passes_an_object_and_none_is_lost():
    where = room(scene(BODY, DESK), 12, "k_epsilon")
    model = where.model(parameters(where, 60.0))
    flow = where.at_rest(model, np.zeros(where.grid.cells[2]))
    for _ in range(5):
        flow = advanced(flow, model)

    solids = model.boundary.solids
    assert solids is not None
    for a in range(3):
        assert float(jnp.abs(flow.velocity[a] * (1.0 - solids.open_faces[a])).max()) == 0.0
    # Float32: the unit of the last place of the fastest air over a cell, a few times.
    scale = max(float(jnp.abs(v).max()) for v in flow.velocity) / min(where.grid.spacing_m)
    assert float(jnp.abs(divergence_per_s(flow.velocity, where.grid)).max()) < 1e-5 * scale
    assert scale > 0


def test_the_air_takes_up_what_objects_give_and_the_supply_brings():
    """d/dt of the air's heat = objects + inflow - outflow, in one pair of steps; all else is adiabatic."""
    where = room(scene(BODY, DESK), 12, "k_epsilon")
    model = where.model(parameters(where, 60.0))
    flow = where.at_rest(model, np.zeros(where.grid.cells[2]))
    for _ in range(10):
        flow = advanced(flow, model)
    after = advanced(flow, model)

    solids = model.boundary.solids
    assert solids is not None
    air = np.asarray(solids.air, float)
    volume, capacity = where.grid.volume_m3, where.scene.air.heat_capacity_j_m3_k
    gained = (
        float(((np.asarray(after.excess_k, float) - np.asarray(flow.excess_k, float)) * air).sum()) * volume
    )
    wall = model.boundary.walls[0][0]
    inward = np.asarray(wall.normal_m_s, float)
    beside = 0.5 * (np.asarray(flow.excess_k[0], float) + np.asarray(after.excess_k[0], float))
    carried = np.where(inward > 0, inward * np.asarray(wall.inflow_excess_k), inward * beside)
    brought = 60.0 / capacity + float(carried.sum()) * where.grid.face_area_m2(0)

    assert gained / 0.1 == pytest.approx(brought, rel=1e-3)


def test_a_room_without_objects_has_no_solids():
    where = room(scene(), 8, "k_epsilon")
    assert where.layout.solids is None
    assert where.model(parameters(where, 0.0)).boundary.solids is None


def test_the_capacitance_matrix_agrees_with_a_direct_solution():
    """Any flow is projected as the dense pseudo-inverse of the divergence between cells of air does it."""
    where = room(scene(BODY), 8, "k_epsilon")
    model = where.model(parameters(where, 0.0))
    solids, grid = model.boundary.solids, where.grid
    assert solids is not None
    assert isinstance(model.pressure, ObstructedSolver)
    rng = np.random.default_rng(0)
    shapes = [[n + (a == b) for b, n in enumerate(grid.cells)] for a in range(3)]
    velocity = [jnp.asarray(rng.standard_normal(s), jnp.float32) for s in shapes]
    for a in range(3):
        ends = tuple(jnp.array([0, -1]) if a == b else slice(None) for b in range(3))
        velocity[a] = velocity[a].at[ends].set(0.0)
    u, v, w = velocity
    found, _ = project_obstructed((u, v, w), jnp.float32(1.0), grid, model.pressure)

    # Open inner faces are the unknowns; their divergence in cells of air, and its dense pseudo-inverse.
    columns, values = [], []
    air = np.asarray(solids.air).ravel() > 0
    index = np.arange(air.size).reshape(grid.cells)
    for a in range(3):
        is_open = np.asarray(solids.open_faces[a]) > 0
        inner = tuple(slice(1, -1) if a == b else slice(None) for b in range(3))
        low = index[tuple(slice(None, -1) if a == b else slice(None) for b in range(3))][is_open[inner]]
        high = index[tuple(slice(1, None) if a == b else slice(None) for b in range(3))][is_open[inner]]
        part = np.zeros((air.size, len(low)))
        part[low, np.arange(len(low))] = 1.0 / grid.spacing_m[a]
        part[high, np.arange(len(low))] = -1.0 / grid.spacing_m[a]
        columns.append(part)
        values.append(np.asarray(velocity[a], float)[inner][is_open[inner]])
    divergence, before = np.concatenate(columns, 1)[air], np.concatenate(values)
    expected = before - np.linalg.pinv(divergence) @ (divergence @ before)
    got = np.concatenate(
        [
            np.asarray(found[a], float)[inner][np.asarray(solids.open_faces[a])[inner] > 0]
            for a in range(3)
            for inner in [tuple(slice(1, -1) if a == b else slice(None) for b in range(3))]
        ]
    )

    assert got == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize(
    ("objects", "words"),
    [
        ((RoomObject(name="a", lower_m=(1.0, 1.0, 0.0), upper_m=(2.5, 1.5, 1.0)),), "Move it into the room"),
        (
            (RoomObject(name="a", lower_m=(0.0, 0.5, 0.0), upper_m=(0.5, 1.5, 1.0)),),
            "stands against the inlet",
        ),
        ((BODY, RoomObject(name="b", lower_m=(1.0, 1.0, 0.0), upper_m=(1.5, 1.5, 1.0))), "overlap"),
        ((BODY, BODY), "a name of its own"),
    ],
)
def test_objects_that_cannot_be_are_refused(objects: tuple[RoomObject, ...], words: str):
    with pytest.raises(SettingError, match=words):
        scene(*objects)


def test_objects_that_shut_off_a_part_of_the_room_are_refused():
    across = RoomObject(name="wall", lower_m=(0.9, 0.0, 0.0), upper_m=(1.1, 2.0, 2.0))
    with pytest.raises(SettingError, match="shut off a part"):
        room(scene(across), 10, "k_epsilon")


def test_an_object_says_what_it_lacks():
    with pytest.raises(SettingError, match="give power_w with thermal = 'power'"):
        RoomObject(name="a", lower_m=(0.0, 0.0, 0.0), upper_m=(1.0, 1.0, 1.0), thermal="power")
