"""A view of any wall is the same view in a turned room: shifts, pictures, places, and what a scene refuses."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from core.estimate.prior import looked_through
from core.fields import FunctionField, GridField
from core.geometry import WALLS, Box, WallName, face_of, looking_along_y
from core.objects import RoomObject
from core.rays.operator import build
from core.rays.visibility import sees_wall, wall_points
from core.render import render_flow, render_reference
from core.scene import FixedTexture, ProjectedPattern, Scene, View
from core.setting import SettingError
from core.view_frame import TurnedField, facing, field_facing, looked_along, passed_walls, turn_to

SHAPE = (9, 7, 8)
CAMERA = looking_along_y(position_m=(1.0, -2.0, 0.75), width_px=64, height_px=48, focal_px=120.0)
PROJECTOR = looking_along_y(position_m=(1.6, -2.0, 0.5), width_px=96, height_px=72, focal_px=100.0)
SHELF = RoomObject(name="shelf", lower_m=(0.2, 1.4, 0.1), upper_m=(0.7, 2.0, 0.6))
AHEAD = Scene(
    room=Box(lower_m=(0.0, 0.0, 0.0), upper_m=(2.0, 2.0, 1.5)),
    views=(View(camera=CAMERA),),
    light=FixedTexture(pixel_m=0.02),
    objects=(SHELF,),
)
LIT = replace(AHEAD, light=ProjectedPattern(projector=PROJECTOR))
PIXELS = np.stack(np.meshgrid(np.linspace(4, 59, 9), np.linspace(4, 43, 7)), -1).reshape(-1, 2)


def air() -> np.ndarray:
    return (1e-5 * np.random.default_rng(3).standard_normal(SHAPE)).astype(np.float32)


def elsewhere(scene: Scene, wall: WallName) -> Scene:
    """The same room, camera and light, all turned so that what was y_max is `wall`."""
    back = turn_to(wall).back()
    light = scene.light
    if isinstance(light, ProjectedPattern):
        light = replace(light, projector=back.optics(light.projector))
    view = replace(scene.views[0], wall=wall, light=light, camera=back.optics(scene.views[0].camera))
    return replace(
        scene,
        room=back.box(scene.room),
        views=(view,),
        light=FixedTexture(),
        objects=tuple(back.thing(item) for item in scene.objects),
    )


@pytest.mark.parametrize("scene", [AHEAD, LIT], ids=["print", "projector"])
@pytest.mark.parametrize("wall", WALLS)
def test_a_view_of_any_wall_is_the_same_view_in_a_turned_room(wall, scene):
    turned, back = elsewhere(scene, wall), turn_to(wall).back()
    values = air()
    there = np.asarray(back.volume(jnp.asarray(values)))
    assert there.shape == back.shape(SHAPE)

    here_px = np.asarray(build(scene, 0, PIXELS, SHAPE, 4.0).apply(jnp.asarray(values)))
    operator = build(turned, 0, PIXELS, there.shape, 4.0)
    np.testing.assert_allclose(operator.apply(jnp.asarray(there)), here_px, atol=2e-5 * np.abs(here_px).max())
    assert np.abs(here_px).max() > 1e-4
    # The transpose is that of the turned room's own vertices.
    rows = np.random.default_rng(1).standard_normal(here_px.shape).astype(np.float32)
    given = np.asarray(operator.transpose(jnp.asarray(rows)))
    assert given.shape == there.shape
    assert np.sum(given * there, dtype=float) == pytest.approx(np.sum(rows * here_px, dtype=float), rel=1e-4)

    seen = sees_wall(scene, 0, PIXELS, 2.0)
    np.testing.assert_array_equal(sees_wall(turned, 0, PIXELS, 2.0), seen)
    assert 0 < seen.sum() < len(seen)
    on_wall = wall_points(turned, 0, PIXELS)
    face = face_of(wall)
    np.testing.assert_allclose(on_wall[:, face.axis], face.place_m(turned.room), atol=1e-9)
    np.testing.assert_allclose(on_wall @ back.back().matrix.T, wall_points(scene, 0, PIXELS), atol=1e-9)


@pytest.mark.parametrize("wall", ["x_min", "z_max"])
def test_its_pictures_are_the_same(wall):
    turned, back = elsewhere(AHEAD, wall), turn_to(wall).back()
    field = GridField(AHEAD.room.lower_m, AHEAD.room.upper_m, 1e3 * air())
    there = field_facing(field, back)
    still = render_reference(AHEAD)
    np.testing.assert_allclose(render_reference(turned), still, atol=1e-5)
    moved = render_flow(AHEAD, field)
    np.testing.assert_allclose(render_flow(turned, there), moved, atol=1e-4)
    assert np.abs(moved - still).max() > 1e-2


@pytest.mark.parametrize("wall", WALLS)
def test_a_field_has_the_same_slope_in_both_frames(wall):
    turn = turn_to(wall)
    formula = FunctionField(lambda point: point[0] + 2.0 * point[1] + 3.0 * point[2] ** 2)
    turned = field_facing(formula, turn)
    assert isinstance(turned, TurnedField) or wall == "y_max"
    points_m = np.array([[0.3, -0.2, 0.7], [1.0, 2.0, -0.5]], np.float32)
    value, slope = formula.excess_and_gradient(jnp.asarray(points_m))
    own_value, own_slope = turned.excess_and_gradient(jnp.asarray(points_m @ turn.matrix.T, jnp.float32))
    np.testing.assert_allclose(own_value, value, rtol=1e-6)
    np.testing.assert_allclose(own_slope @ turn.matrix, slope, rtol=1e-6)


def test_every_wall_has_a_rotation_and_the_back_wall_none():
    for wall in WALLS:
        turn, face = turn_to(wall), face_of(wall)
        outward = np.zeros(3)
        outward[face.axis] = 1.0 if face.upper else -1.0
        np.testing.assert_array_equal(turn.matrix @ outward, [0.0, 1.0, 0.0])
        assert np.linalg.det(turn.matrix) == pytest.approx(1.0)
    assert turn_to("y_max").is_none
    assert facing(AHEAD, 0) == (AHEAD, 0)
    assert facing(AHEAD, 0)[0] is AHEAD


def test_the_axes_that_views_look_along():
    views = [elsewhere(AHEAD, wall).views[0] for wall in ("x_max", "z_min", "x_min")]
    names = [replace(view, name=str(n)) for n, view in enumerate(views)]
    assert [looked_along(replace(AHEAD, views=(*AHEAD.views, *names[:n]))) for n in range(4)] == [
        (1,),
        (0, 1),
        (0, 1, 2),
        (0, 1, 2),
    ]


def test_the_walls_that_rays_pass():
    """Both ends of the axis that is looked along, unless the camera stands in the room."""
    side = elsewhere(AHEAD, "x_min")
    assert passed_walls(AHEAD.views[0], AHEAD.room) == {"y_min", "y_max"}
    assert passed_walls(side.views[0], side.room) == {"x_min", "x_max"}
    assert (looked_through(AHEAD), looked_through(side)) == (("y_min", "y_max"), ("x_min", "x_max"))

    inside = replace(AHEAD.views[0], camera=replace(CAMERA, position_m=(1.0, 0.1, 0.75)))
    assert passed_walls(inside, AHEAD.room) == {"y_max"}
    assert looked_through(replace(AHEAD, views=(inside,))) is None


def test_views_that_cannot_be_are_refused_by_name():
    own = AHEAD.views[0]
    with pytest.raises(SettingError, match="Two views are called 'camera'"):
        replace(AHEAD, views=(own, own))
    with pytest.raises(SettingError, match=r"is in or behind the wall x_min, x = 0 m; .* \(larger x\)"):
        replace(
            AHEAD, views=(replace(own, wall="x_min", camera=replace(CAMERA, position_m=(-1.0, 1.0, 1.0))),)
        )
    with pytest.raises(SettingError, match="looks at x_max, and the scene's projector lights y_max"):
        replace(LIT, views=(replace(own, wall="x_max", camera=replace(CAMERA, position_m=(-1.0, 1.0, 1.0))),))
