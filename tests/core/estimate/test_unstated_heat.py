"""Heat that nobody stated: where panels lie, what of them is fitted and shown, and what is said of them."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from core.estimate.diagnostics import missing_heat, suspicion, undetermined, where_else
from core.estimate.prior import room_prior
from core.estimate.temperature_levels import free_vertices
from core.estimate.unstated_heat import (
    Residual,
    Suspect,
    is_placed,
    likely_span_m,
    panels_along,
    with_heaters,
    with_suspected_heat,
)
from core.geometry import WallName
from core.problem import Problem
from core.room.boundary_conditions import boundary
from core.room.forward import room
from core.scene import Heater, Inlet, Outlet, Patch
from core.view_frame import told_on_floor
from tests.core.estimate.test_temperature_levels import VERTICES, problem


def with_panels(given: Problem) -> Problem:
    """The problem with the five panels along x that cover the floor's length."""
    return with_heaters(given, panels_along(given, 0, (1.0, 1.0))[::2])


def seen_from(given: Problem, *walls: WallName) -> Problem:
    """The problem with a view of each of these walls."""
    (view,) = given.scene.views
    return replace(
        given, scene=replace(given.scene, views=tuple(replace(view, name=wall, wall=wall) for wall in walls))
    )


def test_panels_lie_from_wall_to_wall_and_overlap_by_half():
    given = problem(stated=False)
    along_x, along_y = (panels_along(given, axis, (1.0, 1.0)) for axis in (0, 1))

    edges = [(p.patch.lower_m[0], p.patch.upper_m[0]) for p in along_x]
    np.testing.assert_allclose(edges, [(0.2 * n, 0.2 * n + 0.4) for n in range(9)], atol=1e-9)
    np.testing.assert_allclose([(p.patch.lower_m[1], p.patch.upper_m[1]) for p in along_x], [(0.8, 1.2)] * 9)
    np.testing.assert_allclose([p.patch.lower_m[1] for p in along_y], [0.2 * n for n in range(9)], atol=1e-9)
    # As warm as the air that leaves, so that nothing drives anything before the images are asked.
    assert [p.temperature_k for p in along_x] == pytest.approx([298.15] * 9)


@pytest.mark.parametrize(
    ("walls", "told"),
    [(("y_max",), (0,)), (("x_min",), (1,)), (("y_max", "x_max"), (0, 1)), (("z_max",), (0, 1))],
)
def test_a_view_tells_every_axis_of_the_floor_but_the_one_it_looks_along(
    walls: tuple[WallName, ...], told: tuple[int, ...]
):
    assert told_on_floor(seen_from(problem(stated=False), *walls).scene) == told


@pytest.mark.parametrize("strength", [0.2, 5.0])
def test_a_plume_is_known_by_its_shape_however_strong_it_was_tried(strength: float):
    rng = np.random.default_rng(2)
    plume = rng.normal(size=400)
    left = 0.5 * plume + 0.1 * rng.normal(size=400)
    residual = Residual(left, np.zeros(400), np.full(400, 1e-4), np.zeros((400, 1)))

    likeness, scale = residual.matched(strength * plume)
    other, _ = residual.matched(strength * rng.normal(size=400))

    # Too strong, it would leave more than nothing does.
    assert strength < 1.0 or np.linalg.norm(left - strength * plume) > np.linalg.norm(left)
    assert likeness > 0.95
    assert scale * strength == pytest.approx(0.5, abs=0.02)
    assert abs(other) < 0.2


def test_what_a_fitted_parameter_may_do_is_not_taken_for_a_plume():
    rng = np.random.default_rng(3)
    plume, wall = rng.normal(size=(2, 400))
    left, variance = plume + 3.0 * wall, np.full(400, 1e-2)
    told, untold = (Residual(left, np.zeros(400), variance, of[:, None]) for of in (10.0 * wall, 0.0 * wall))

    # A panel that warms the air as the wall does, and less where the plume is.
    like_the_wall = wall + 0.3 * rng.normal(size=400)

    assert untold.matched(like_the_wall)[0] > 0.8
    assert abs(told.matched(like_the_wall)[0]) < 0.2
    assert told.matched(plume)[0] > 0.95


def test_the_suspect_enters_the_fit_with_its_neighbours():
    given = problem(stated=False)
    suspect = Suspect(0.6, 20.0, panels_along(given, 0, (1.0, 1.0))[4])

    added = [b for b in with_suspected_heat(given, suspect).scene.boundary if isinstance(b, Heater)]

    air_k = suspect.panel.temperature_k
    assert [b.temperature_k - air_k for b in added] == pytest.approx([20.0, 0.0, 0.0])
    assert [b.patch.lower_m[0] for b in added] == pytest.approx([0.8, 0.4, 1.2])
    assert {b.temperature_std_k for b in added} == {10.0}
    said = missing_heat(given, suspect.panel, suspect.likeness)
    assert "x = 0.8 to 1.2 m would" in said
    assert "No view tells where along y it is" in said


def test_two_views_place_the_suspect_along_both_axes():
    given = seen_from(problem(stated=False), "y_max", "x_max")
    suspect = Suspect(0.6, 20.0, panels_along(given, 1, (1.0, 1.0))[0])

    added = [b for b in with_suspected_heat(given, suspect).scene.boundary if isinstance(b, Heater)]

    # The suspect lies beside a wall, so it has no neighbour there.
    np.testing.assert_allclose(
        [b.patch.lower_m for b in added], [(0.8, 0.0), (0.4, 0.0), (1.2, 0.0), (0.8, 0.4)], atol=1e-9
    )
    said = missing_heat(given, suspect.panel, suspect.likeness)
    assert "x = 0.8 to 1.2 m, y = 0.0 to 0.4 m would" in said
    assert "assumed" not in said


def test_where_heat_may_stand_is_said_only_if_the_images_do_not_tell_it():
    panels = panels_along(problem(stated=False), 0, (1.0, 1.0))
    likeness = [0.1, 0.2, 0.3, 0.5, 0.8, 0.5, 0.3, 0.78, 0.2]
    suspects = [Suspect(c, 20.0, panel) for c, panel in zip(likeness, panels, strict=True)]

    few, many = (likely_span_m(suspects, 0, count) for count in (20.0, 2000.0))

    # The other likely panel lies from 1.4 to 1.8 m; many data tell it from the best one.
    assert few == pytest.approx((0.8, 1.8))
    assert many == pytest.approx((0.8, 1.2))
    assert (
        "along x this heat stands: it may be anywhere from 0.8 to 1.8 m"
        in where_else(panels[4], [(0, *few)])[0]
    )
    assert where_else(panels[4], [(0, *many)]) == ()


def test_heat_is_placed_only_if_it_may_not_stand_all_along_the_room():
    given = problem(stated=False)
    panels = panels_along(given, 0, (1.0, 1.0))

    def placed(*likeness: float) -> bool:
        suspects = [Suspect(c, 20.0, panel) for c, panel in zip(likeness, panels, strict=True)]
        span_m = likely_span_m(suspects, 0, 20.0)
        return is_placed(suspects[4]._replace(spans_m=((0, *span_m),)), given)

    assert placed(0.1, 0.2, 0.3, 0.5, 0.8, 0.5, 0.3, 0.78, 0.2)
    assert not placed(0.0, 0.01, 0.03, 0.05, 0.08, 0.05, 0.03, 0.07, 0.02)
    # One of two axes is enough.
    whole = (0, given.scene.room.lower_m[0], given.scene.room.upper_m[0])
    assert is_placed(Suspect(0.4, 20.0, panels[4], (whole, (1, 0.2, 0.8))), given)


def test_a_panel_is_left_out_where_another_patch_lies():
    given = problem(stated=False)
    stated = Heater(patch=Patch(wall="z_min", lower_m=(0.5, 0.9), upper_m=(0.7, 1.1)), temperature_k=310.0)
    scene = replace(given.scene, boundary=(*given.scene.boundary, stated))
    found = panels_along(Problem(scene, ()), 0, (1.0, 1.0))

    np.testing.assert_allclose([p.patch.lower_m[0] for p in found], [0.0, 0.8, 1.0, 1.2, 1.4, 1.6], atol=1e-9)


def test_a_panel_s_heat_is_fitted_and_its_temperature_shown_nowhere():
    given = with_panels(problem(stated=False))
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


def test_what_the_images_ask_for_is_said_and_a_panel_that_hardly_moved_is_not():
    given = problem(stated=False)
    panel = panels_along(given, 0, (1.0, 1.0))[6]
    (said,) = suspicion(given, panel, 42.3)

    assert "0.40 x 0.40 m, 42 K warmer than the air, at x = 1.2 to 1.6 m" in said
    assert "State it as a heater." in said
    assert suspicion(given, panel, 3.0) == []


def test_a_room_that_only_suspected_heat_drives_is_still_called_undetermined():
    given = problem(stated=False)
    openings = tuple(b for b in given.scene.boundary if not isinstance(b, Inlet | Outlet))
    closed = Problem(replace(given.scene, boundary=openings), ())

    assert undetermined(with_panels(closed)) == undetermined(closed)
