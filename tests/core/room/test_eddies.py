"""Large eddies: what disturbs a supply, and a march that any run repeats."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from core.estimate.prior import room_prior
from core.geometry import WALLS, Box, looking_along_y
from core.problem import Problem
from core.room.eddies import stirred
from core.room.forward import LARGE_EDDIES, Room, room
from core.room.march import March, MarchSettings, march
from core.room.step import Flow, RoomModel
from core.room.wall_planes import set_normal
from core.scene import FixedTexture, Inlet, Outlet, Patch, Scene, View, Wall

INTENSITY, SPEED_M_S = 0.2, 0.5
SETTINGS = MarchSettings(
    longest_s=8.0, window_s=2.0, tolerance=0.0, level_ahead_s=0.0, steady=False, mean_windows=2, chunk_steps=4
)


def jet(intensity: float, cells: int = 24) -> tuple[Room, RoomModel]:
    supply = Inlet(
        patch=Patch(wall="x_min", lower_m=(0.4, 1.0), upper_m=(1.6, 1.6)),
        temperature_k=293.15,
        velocity_m_s=(SPEED_M_S, 0.0, 0.0),
        turbulence_intensity=intensity,
    )
    exhaust = Outlet(patch=Patch(wall="x_max", lower_m=(0.4, 0.2), upper_m=(1.6, 0.8)))
    scene = Scene(
        room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=(2.0, 2.0, 2.0)),
        views=(
            View(
                camera=looking_along_y(position_m=(1.0, -8.0, 1.0), width_px=64, height_px=64, focal_px=200.0)
            ),
        ),
        light=FixedTexture(),
        boundary=(supply, exhaust, *(Wall(wall=name, thermal="adiabatic") for name in WALLS)),
    )
    where = room(scene, cells, LARGE_EDDIES)
    return where, where.model(room_prior(Problem(scene, ()), where.layout).mean)


def started(where: Room, model: RoomModel) -> Flow:
    rest = where.at_rest(model, np.zeros(where.grid.cells[2]))
    return replace(rest, velocity=set_normal(rest.velocity, model.boundary))


def marched(intensity: float) -> March:
    where, model = jet(intensity)
    return march(started(where, model), model, SETTINGS)


def test_a_supply_is_disturbed_along_its_wall_by_its_own_turbulent_energy():
    model = jet(INTENSITY)[1]
    calm, moments = model.boundary.walls[0][0], range(40)
    draws = [stirred(model.boundary, jnp.int32(n)).walls[0][0] for n in moments]
    moved = np.array([[np.asarray(w.tangent_m_s[a] - calm.tangent_m_s[a]) for a in (0, 1)] for w in draws])
    supplied = np.asarray(calm.normal_m_s) > 0

    energy = 0.5 * (moved**2).sum(1)[:, supplied].mean()
    assert energy == pytest.approx(1.5 * (INTENSITY * SPEED_M_S) ** 2, rel=0.1)
    assert not moved[:, :, ~supplied].any()
    # Neither from draw to draw, nor from cell to cell.
    assert abs(np.corrcoef(moved[0, 0][supplied], moved[1, 0][supplied])[0, 1]) < 0.4
    assert all((np.asarray(w.normal_m_s) == np.asarray(calm.normal_m_s)).all() for w in draws)


def test_other_walls_stay_as_they_are():
    model = jet(INTENSITY)[1]
    after = stirred(model.boundary, jnp.int32(3))
    others = [(a, end) for a in range(3) for end in range(2) if (a, end) != (0, 0)]
    for a, end in others:
        before, now = (jax.tree.leaves(b.walls[a][end]) for b in (model.boundary, after))
        assert all((np.asarray(x) == np.asarray(y)).all() for x, y in zip(before, now, strict=True))


def test_a_march_of_large_eddies_is_the_same_each_time_and_goes_on_where_it_was_cut():
    where, model = jet(INTENSITY)
    states: list = []
    whole = march(started(where, model), model, SETTINGS, on_window=states.append)
    again = march(started(where, model), model, SETTINGS, begun=states[1])
    for one, other in zip(jax.tree.leaves(whole.mean), jax.tree.leaves(again.mean), strict=True):
        assert (np.asarray(one) == np.asarray(other)).all()


def test_a_disturbed_jet_leaves_the_symmetry_of_its_room():
    def apart(intensity: float) -> float:
        along_x = np.asarray(marched(intensity).last.velocity[0])
        return float(np.abs(along_x - along_x[:, ::-1]).max()) / SPEED_M_S

    assert apart(0.0) < 1e-3
    assert apart(INTENSITY) > 0.05
