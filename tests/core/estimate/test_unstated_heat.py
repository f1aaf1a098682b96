"""Heat that nobody stated: where strips lie, what of them is fitted and shown, and what is said of them."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from core.estimate.diagnostics import suspicion, undetermined
from core.estimate.forward_runs import differences
from core.estimate.prior import room_prior
from core.estimate.temperature_nudging import free_vertices
from core.estimate.unstated_heat import adjoin, floor_strips, with_heaters
from core.problem import Problem
from core.room.boundary_conditions import boundary
from core.room.forward import room
from core.scene import Heater, Inlet, Outlet, Patch
from tests.core.estimate.test_temperature_nudging import VERTICES, problem


def with_strips(given: Problem) -> Problem:
    return with_heaters(given, floor_strips(given))


def test_strips_cover_the_floor_from_end_to_end_half_way_into_the_room():
    found = floor_strips(problem(stated=False))

    edges = [(s.patch.lower_m[0], s.patch.upper_m[0]) for s in found]
    np.testing.assert_allclose(edges, [(0.4 * n, 0.4 * n + 0.4) for n in range(5)])
    assert {(s.patch.wall, s.patch.lower_m[1], s.patch.upper_m[1]) for s in found} == {("z_min", 0.8, 1.2)}
    # As warm as the air that leaves, so that nothing drives anything before the images are asked.
    assert [s.temperature_k for s in found] == pytest.approx([298.15] * 5)
    assert [adjoin(found[2], other) for other in found] == [False, True, False, True, False]


def test_strips_half_way_between_adjoin_one_another_only():
    given = problem(stated=False)
    found, between = floor_strips(given), floor_strips(given, between=True)

    edges = [(s.patch.lower_m[0], s.patch.upper_m[0]) for s in between]
    np.testing.assert_allclose(edges, [(0.4 * n + 0.2, 0.4 * n + 0.6) for n in range(4)])
    assert [adjoin(between[1], other) for other in between] == [True, False, True, False]
    assert not any(adjoin(between[1], other) for other in found)


def test_a_strip_is_left_out_where_another_patch_lies():
    given = problem(stated=False)
    stated = Heater(patch=Patch(wall="z_min", lower_m=(0.5, 0.9), upper_m=(0.7, 1.1)), temperature_k=310.0)
    scene = replace(given.scene, boundary=(*given.scene.boundary, stated))
    found = floor_strips(Problem(scene, ()))

    np.testing.assert_allclose([s.patch.lower_m[0] for s in found], [0.0, 0.8, 1.2, 1.6])


def test_a_strip_s_heat_is_fitted_and_its_temperature_shown_nowhere():
    given = with_strips(problem(stated=False))
    layout = room(given.scene, 8, "constant").layout
    prior = room_prior(given, layout)
    heaters = [name for name in prior.names() if name.startswith("heater")]
    warm = eqx.tree_at(lambda p: p.heater_excess_k, prior.mean, jnp.full(5, 40.0))
    floor = boundary(layout, warm).walls[2][0]

    assert heaters == [f"heater_excess_k[{n}]" for n in range(5)]
    assert prior.suspected().sum() == 5
    # Beside suspected heat, nothing that was entered is let go as well.
    np.testing.assert_array_equal(prior.gaussian(), ~prior.suspected())
    np.testing.assert_allclose(differences(prior)[prior.suspected()], 1.0)
    assert layout.shown == (False,) * 5
    assert float(floor.wall_excess_k.max()) > 20.0
    assert float(floor.held[floor.wall_excess_k > 20.0].max()) == 0.0
    free = free_vertices(layout, VERTICES)
    assert np.all(free[1:-1, 1:-1, 1:-1] == 1.0)
    assert free[:, :, 0].max() > 0.5


def test_what_the_images_ask_for_is_said_and_a_strip_that_hardly_moved_is_not():
    strip = floor_strips(problem(stated=False))[3]
    (said,) = suspicion(strip, 42.3)

    assert "0.40 x 0.40 m, 42 K warmer than the air, at x = 1.2 to 1.6 m" in said
    assert "State it as a heater." in said
    assert suspicion(strip, 3.0) == []


def test_a_room_that_only_suspected_heat_drives_is_still_called_undetermined():
    given = problem(stated=False)
    openings = tuple(b for b in given.scene.boundary if not isinstance(b, Inlet | Outlet))
    closed = Problem(replace(given.scene, boundary=openings), ())

    assert undetermined(with_strips(closed)) == undetermined(closed)
