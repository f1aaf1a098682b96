import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from core.estimate.prior import room_prior
from core.estimate.temperature_levels import free_vertices
from core.geometry import Box, looking_along_y
from core.problem import Problem
from core.room.boundary_conditions import RoomParameters, boundary, room_layout
from core.room.closure import ConstantClosure, KEpsilonClosure
from core.room.k_epsilon import wall_sources
from core.room.level import layer_exchange_m3_s
from core.room.march import advance_chunk
from core.room.pace import step_limits
from core.room.pressure import divergence_per_s
from core.room.room_grid import room_grid
from core.room.step import air_at_rest, room_model
from core.room.vertices import vertex_excess_k, vertex_velocity_m_s
from core.room.wall_planes import closed_room
from core.scene import FixedTexture, Heater, Inlet, Outlet, Patch, Scene, View, Wall
from core.setting import SettingError

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 2.5))
SUPPLY = Inlet(
    patch=Patch(wall="x_min", lower_m=(1.13, 1.5), upper_m=(1.87, 1.77)),
    temperature_k=303.15,
    velocity_m_s=(0.5, 0.0, 0.1),
)
EXHAUST = Outlet(patch=Patch(wall="z_min", lower_m=(3.0, 1.0), upper_m=(3.5, 2.0)))
HIGH = Outlet(patch=Patch(wall="x_max", lower_m=(1.0, 2.0), upper_m=(2.0, 2.2)))
FLOOR = Heater(patch=Patch(wall="z_min", lower_m=(1.0, 1.0), upper_m=(2.0, 2.0)), temperature_k=313.15)


def scene(*parts) -> Scene:
    camera = looking_along_y(position_m=(2.0, -5.0, 1.2), width_px=40, height_px=30, focal_px=60.0)
    return Scene(room=ROOM, views=(View(camera=camera),), light=FixedTexture(), boundary=parts)


def parameters(inlets: int, heaters: int) -> RoomParameters:
    return RoomParameters(
        jnp.full(inlets, 10.0),
        jnp.zeros(inlets),
        jnp.float32(0.0),
        jnp.zeros(6),
        jnp.full(6, np.log(1e-3)),
        jnp.full(heaters, 20.0),
        jnp.full(heaters, np.log(3e-3)),
        jnp.float32(0.0),
        jnp.zeros((3, 3, 4)),
    )


def test_openings_keep_their_flow_and_momentum_on_any_grid():
    for cells in (7, 12):
        grid = room_grid(ROOM, cells)
        layout = room_layout(scene(SUPPLY, EXHAUST), grid)
        low = boundary(layout, parameters(1, 0)).walls[0][0]

        area = grid.face_area_m2(0)
        patch_m2 = 0.74 * 0.27
        assert float(low.normal_m_s.sum()) * area == pytest.approx(0.5 * patch_m2, rel=1e-5)
        # Through the faces, and as a force on the first cells: together U^2 A.
        momentum = float((low.normal_m_s**2).sum()) * area + float(low.force_m_s2.sum()) * grid.volume_m3
        assert momentum == pytest.approx(0.25 * patch_m2, rel=1e-5)


@pytest.mark.parametrize("cells", [7, 12, 20])
@pytest.mark.parametrize("cold_first", [False, True])
def test_supplies_that_share_a_cells_face_bring_what_each_of_them_brings(cells: int, cold_first: bool):
    cold = dataclasses.replace(
        SUPPLY,
        patch=Patch(wall="x_min", lower_m=(1.87, 1.5), upper_m=(2.4, 1.77)),
        velocity_m_s=(0.3, 0.0, 0.0),
    )
    pair, excess_k = (SUPPLY, cold), jnp.array([10.0, -10.0])
    if cold_first:
        pair, excess_k = pair[::-1], excess_k[::-1]
    grid = room_grid(ROOM, cells)
    given = dataclasses.replace(parameters(2, 0), inlet_excess_k=excess_k)
    low = boundary(room_layout(scene(*pair, EXHAUST), grid), given).walls[0][0]

    area, areas_m2 = grid.face_area_m2(0), (0.74 * 0.27, 0.53 * 0.27)
    heat = float((low.normal_m_s * low.inflow_excess_k).sum()) * area
    assert heat == pytest.approx(10.0 * (0.5 * areas_m2[0] - 0.3 * areas_m2[1]), rel=1e-4)
    momentum = float((low.normal_m_s**2).sum()) * area + float(low.force_m_s2.sum()) * grid.volume_m3
    assert momentum == pytest.approx(0.25 * areas_m2[0] + 0.09 * areas_m2[1], rel=1e-4)


def test_a_supply_that_shares_a_cells_face_with_an_outlet_is_told():
    beside = Outlet(patch=Patch(wall="x_min", lower_m=(1.9, 1.5), upper_m=(2.4, 1.77)))
    coarse, fine = (room_layout(scene(SUPPLY, beside), room_grid(ROOM, cells)).notes for cells in (7, 100))

    assert any("share a cell" in note for note in coarse)
    assert not any("share a cell" in note for note in fine)


@pytest.mark.parametrize(
    ("low_m3_s", "high_m3_s", "low_share"),
    # The supply brings 0.0999 m3/s; the outlets' areas are 0.5 and 0.2 m2.
    [(None, None, 5 / 7), (0.0333, None, 1 / 3), (None, 0.0333, 2 / 3), (0.3, 0.1, 3 / 4)],
)
def test_outlets_share_what_leaves_as_their_flows_are_stated(low_m3_s, high_m3_s, low_share):
    outlets = (
        dataclasses.replace(one, flow_m3_s=flow)
        for one, flow in zip((EXHAUST, HIGH), (low_m3_s, high_m3_s), strict=True)
    )
    grid = room_grid(ROOM, 9)
    layout = room_layout(scene(SUPPLY, *outlets), grid)
    walls = boundary(layout, parameters(1, 0)).walls

    through_m3_s = [
        float(jnp.sum(walls[axis][end].normal_m_s)) * grid.face_area_m2(axis)
        for axis, end in ((2, 0), (0, 1))
    ]
    supplied_m3_s = 0.5 * 0.74 * 0.27
    assert -through_m3_s[0] == pytest.approx(low_share * supplied_m3_s, rel=1e-5)
    assert through_m3_s[1] == pytest.approx((1 - low_share) * supplied_m3_s, rel=1e-5)


def test_flows_of_outlets_that_are_not_what_the_supplies_bring_are_told():
    low, high = (dataclasses.replace(one, flow_m3_s=0.05) for one in (EXHAUST, HIGH))
    grid = room_grid(ROOM, 9)
    told = room_layout(scene(SUPPLY, low, dataclasses.replace(high, flow_m3_s=0.1)), grid).notes
    assert any("540 m3/h in all, but the supplies bring 359.6 m3/h" in note for note in told)
    for outlets in ((low, high), (low, HIGH)):
        assert not any("in all" in note for note in room_layout(scene(SUPPLY, *outlets), grid).notes)


def test_an_outlet_to_which_the_others_leave_nothing_is_refused():
    low = dataclasses.replace(EXHAUST, flow_m3_s=0.1)
    with pytest.raises(SettingError, match=r"360 m3/h in all and the supplies bring 359\.6 m3/h"):
        room_layout(scene(SUPPLY, low, HIGH), room_grid(ROOM, 9))
    with pytest.raises(SettingError, match="above 0 and below 100 m3/s"):
        dataclasses.replace(EXHAUST, flow_m3_s=0.0)


def test_a_faster_supply_brings_turbulence_as_its_speed_says():
    layout = room_layout(scene(SUPPLY, EXHAUST), room_grid(ROOM, 8))
    stated = parameters(1, 0)
    twice = dataclasses.replace(stated, inlet_log_flow=jnp.full(1, np.log(2.0)))
    slow, fast = (boundary(layout, given).walls[0][0] for given in (stated, twice))

    # k goes as the speed squared, epsilon = C k^1.5 / length as its cube.
    for name, ratio in (("normal_m_s", 2.0), ("turbulent_energy_m2_s2", 4.0), ("dissipation_m2_s3", 8.0)):
        assert float(getattr(slow, name).max()) > 0
        np.testing.assert_allclose(getattr(fast, name), ratio * getattr(slow, name), rtol=1e-5)


def test_a_grid_puts_faces_on_the_edges_of_openings_where_that_takes_few_more_cells():
    box = Box(lower_m=(-1.2, -1.5, 0.0), upper_m=(2.9, 1.5, 3.0))

    grid = room_grid(box, 48, ((), (-0.3, 0.3), (1.6, 1.8, 0.2, 0.6)))

    for axis, edges in ((1, (-0.3, 0.3)), (2, (1.6, 1.8, 0.2, 0.6))):
        for edge_m in edges:
            assert np.abs(grid.faces_m(axis) - edge_m).min() < 1e-9
    bare = room_grid(box, 48)
    assert all(n <= m <= 1.1 * n for n, m in zip(bare.cells, grid.cells, strict=True))


def test_a_free_surface_has_no_wall_function():
    grid = room_grid(ROOM, 8)
    k = jnp.full(grid.cells, 1e-3)
    u, v, w = (jnp.full([n + (a == b) for b, n in enumerate(grid.cells)], 0.1, jnp.float32) for a in range(3))
    velocity = (u, v, w)
    still, free = closed_room(grid), closed_room(grid, no_slip=0.0)

    touched, production, _ = wall_sources(k, velocity, still, grid, jnp.float32(1.5e-5))
    assert float(touched[0, 0, 0]) == 3.0
    assert float(touched[3, 3, 3]) == 0.0
    assert float(production[0, 3, 3]) > 0.0

    touched, production, epsilon = wall_sources(k, velocity, free, grid, jnp.float32(1.5e-5))
    assert not bool(touched.any() | production.any() | epsilon.any())


def test_walls_heat_follows_a_supply_that_is_moved_so_that_the_thermometer_stays():
    walls = [Wall(wall=w, thermal="temperature", temperature_k=293.15) for w in ("x_max", "y_min", "y_max")]
    walls += [Wall(wall=w, thermal="adiabatic") for w in ("x_min", "z_min", "z_max")]
    outlet = dataclasses.replace(EXHAUST, mean_temperature_k=298.15)
    problem = Problem(scene(SUPPLY, outlet, *walls), ())
    prior = room_prior(problem, room_layout(problem.scene, room_grid(ROOM, 8)))
    moved = np.zeros(len(prior.active()))
    moved[prior.names().index("inlet_excess_k[0]")] = -10.0

    stated, found = prior.parameters(np.zeros_like(moved)), prior.parameters(moved)

    # The supply brings 10 - 5 K; moved, less by its ten deviations of 0.2 K.
    gain = float(jnp.exp(found.wall_log_heat[1] - stated.wall_log_heat[1]))
    assert gain == pytest.approx((10.0 - 2.0 - 5.0) / (10.0 - 5.0), rel=1e-4)


def test_a_room_with_jet_outlet_and_heater_marches_without_divergence():
    grid = room_grid(ROOM, 10)
    layout = room_layout(scene(SUPPLY, EXHAUST, FLOOR, Wall(wall="y_min", thermal="adiabatic")), grid)
    model = room_model(
        grid,
        boundary(layout, parameters(1, 1)),
        KEpsilonClosure(jnp.float32(1.0), jnp.float32(1.5e-5)),
        buoyancy_m_s2_k=9.81 / 293.15,
        molecular_m2_s=1.5e-5,
    )
    flow, mean, _ = advance_chunk(
        air_at_rest(model, jnp.zeros(grid.cells), 0.5),
        model,
        jnp.int32(20),
        step_limits(0.45, 0.05, steady=True),
    )

    assert float(jnp.abs(divergence_per_s(flow.velocity, grid)).max()) < 1e-4
    assert float(flow.turbulence.energy_m2_s2.min()) > 0
    vertices = (9, 8, 7)
    excess = np.asarray(vertex_excess_k(flow, model, vertices))
    # Bounded by ambient, supply and heater.
    assert excess.min() > -1e-3
    assert excess.max() < 20.001
    velocity = np.asarray(vertex_velocity_m_s(mean.velocity, model, vertices))
    assert velocity.shape == (9, 8, 7, 3)
    assert np.all(velocity[:, 0] == 0)
    # Two seconds of supply push air along x.
    assert velocity[..., 0].max() > 0.1


def test_a_heater_shows_its_own_temperature_on_its_vertices_which_no_correction_moves():
    grid = room_grid(ROOM, 16)
    walls = (Wall(wall="z_min", thermal="adiabatic"), Wall(wall="y_min", thermal="adiabatic"))
    layout = room_layout(scene(SUPPLY, EXHAUST, FLOOR, *walls), grid)
    closure = KEpsilonClosure(jnp.float32(1.0), jnp.float32(1.5e-5))
    model = room_model(
        grid, boundary(layout, parameters(1, 1)), closure, buoyancy_m_s2_k=0.0, molecular_m2_s=1.5e-5
    )
    # 17, 13 and 11 vertices stand 0.25 m apart: the patch spans those from 1 to 2 m.
    shape = (17, 13, 11)
    excess = np.asarray(vertex_excess_k(air_at_rest(model, jnp.full(grid.cells, 3.0), 0.5), model, shape))
    free = free_vertices(layout, shape)

    assert excess[5:8, 5:8, 0] == pytest.approx(20.0, abs=1e-3)
    assert free[5:8, 5:8, 0] == pytest.approx(0.0, abs=1e-6)
    assert excess[10:12, 5:8, 0] == pytest.approx(3.0)
    assert np.all(free[10:12, 5:8, 0] == 1.0)
    assert np.all(free[:, :-1, 1:-1] == 1.0)
    # The camera looks at y_max, which has a temperature of its own that nobody stated.
    assert np.all(free[:, -1] == 0.0)


def test_a_wall_in_sight_shows_its_temperature_whoever_stated_it_and_another_that_of_the_air():
    grid = room_grid(ROOM, 8)
    stated = Wall(wall="y_max", thermal="temperature", temperature_k=293.15)
    layout = room_layout(scene(SUPPLY, EXHAUST, Wall(wall="x_max", thermal="adiabatic"), stated), grid)
    cold = dataclasses.replace(parameters(1, 0), wall_excess_k=jnp.full(6, -2.0))
    closure = KEpsilonClosure(jnp.float32(1.0), jnp.float32(1.5e-5))
    model = room_model(grid, boundary(layout, cold), closure, buoyancy_m_s2_k=0.0, molecular_m2_s=1.5e-5)

    excess = np.asarray(vertex_excess_k(air_at_rest(model, jnp.full(grid.cells, 3.0), 0.5), model, (9, 9, 9)))

    assert excess[2:-2, 0, 2:-2] == pytest.approx(-2.0, abs=1e-3)
    assert excess[2:-2, -1, 2:-2] == pytest.approx(-2.0, abs=1e-3)
    assert excess[-1, 2:-2, 2:-2] == pytest.approx(3.0)
    assert excess[2:-2, 2:-2, -1] == pytest.approx(3.0)
    assert excess[3:-3, 3:-3, 3:-3] == pytest.approx(3.0)


def test_layers_exchange_all_heat_that_is_not_lost():
    grid = room_grid(ROOM, 8)
    layout = room_layout(scene(SUPPLY, EXHAUST), grid)
    walls = boundary(layout, parameters(1, 0))
    model = room_model(
        grid,
        walls,
        ConstantClosure(jnp.float32(1e-3), jnp.float32(1.5e-5)),
        buoyancy_m_s2_k=0.03,
        molecular_m2_s=1.5e-5,
    )

    lost = layer_exchange_m3_s(air_at_rest(model, jnp.zeros(grid.cells), 0.5), model).sum()

    walls_m2 = 2 * (4 * 3 + 4 * 2.5 + 3 * 2.5) - 0.74 * 0.27 - 0.5
    assert float(lost) == pytest.approx(walls_m2 * 1e-3 + 0.5 * 0.74 * 0.27, rel=1e-4)


@pytest.mark.parametrize(
    ("parts", "sentence"),
    [
        ((SUPPLY,), "cannot leave"),
        ((SUPPLY, EXHAUST, EXHAUST), "overlap"),
        ((Outlet(patch=Patch(wall="y_max", lower_m=(3.0, 1.0), upper_m=(4.5, 2.0))),), "the wall spans"),
        ((Wall(wall="x_min"), Wall(wall="x_min", thermal="adiabatic")), "described 2 times"),
        (
            (Inlet(patch=SUPPLY.patch, temperature_k=300.0, velocity_m_s=(-0.5, 0.0, 0.0)), EXHAUST),
            "does not enter",
        ),
    ],
)
def test_a_boundary_that_cannot_be_is_refused(parts, sentence: str):
    with pytest.raises(SettingError, match=sentence):
        room_layout(scene(*parts), room_grid(ROOM, 8))


def test_a_patch_smaller_than_a_cell_is_noted():
    slit = Outlet(patch=Patch(wall="z_max", lower_m=(1.0, 1.0), upper_m=(1.05, 2.0)))

    layout = room_layout(scene(SUPPLY, slit), room_grid(ROOM, 8))

    assert any("less than the cells'" in note for note in layout.notes)
