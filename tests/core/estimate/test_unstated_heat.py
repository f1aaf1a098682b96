"""Heat that nobody stated: where strips lie, what of them is fitted and shown, and what is said of them."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from core.estimate.diagnostics import missing_heat, suspicion, undetermined
from core.estimate.prior import room_prior
from core.estimate.temperature_levels import free_vertices
from core.estimate.unstated_heat import (
    Suspect,
    adjoin,
    floor_strips,
    matched,
    with_heaters,
    with_suspected_heat,
)
from core.problem import Problem
from core.room.boundary_conditions import boundary
from core.room.forward import room
from core.scene import Heater, Inlet, Outlet, Patch
from tests.core.estimate.test_temperature_levels import VERTICES, problem


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


@pytest.mark.parametrize("strength", [0.2, 5.0])
def test_a_plume_is_known_by_its_shape_however_strong_it_was_tried(strength: float):
    rng = np.random.default_rng(2)
    plume, noise = rng.normal(size=400), np.full(400, 1e-4)
    left = 0.5 * plume + 0.1 * rng.normal(size=400)

    likeness, scale = matched(left, strength * plume, noise)
    other, _ = matched(left, strength * rng.normal(size=400), noise)

    # Too strong, it would leave more than nothing does.
    assert strength < 1.0 or np.linalg.norm(left - strength * plume) > np.linalg.norm(left)
    assert likeness > 0.95
    assert scale * strength == pytest.approx(0.5, abs=0.02)
    assert abs(other) < 0.2


def test_the_suspect_enters_the_fit_with_its_neighbours():
    given = problem(stated=False)
    suspect = Suspect(0.6, 20.0, floor_strips(given)[2])

    added = [b for b in with_suspected_heat(given, suspect).scene.boundary if isinstance(b, Heater)]

    air_k = suspect.strip.temperature_k
    assert [b.temperature_k - air_k for b in added] == pytest.approx([20.0, 0.0, 0.0])
    assert [b.patch.lower_m[0] for b in added] == pytest.approx([0.8, 0.4, 1.2])
    assert {b.temperature_std_k for b in added} == {10.0}
    assert "x = 0.8 to 1.2 m" in missing_heat(suspect.strip, suspect.likeness)


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
