"""Something that stands in the room and was not stated is found, placed and named; an empty room shows nothing."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from app.experiment.folder import ExperimentSettings
from app.experiment.found import found_in
from app.files.toml import from_toml, to_plain, to_toml
from app.reconstruct.cover import covered_windows
from app.reconstruct.found import found_things, what_stands
from app.rig.nuisances import spoiled
from app.rig.rendered import with_objects
from app.simulate.worlds import IDEAL, LAB
from core.displacement import window_centres
from core.geometry import Box, crop, looking_along_y
from core.objects import RoomObject
from core.rays.visibility import hidden_by_objects, sees_wall
from core.render import render_reference
from core.scene import FixedTexture, ProjectedPattern, Scene, SolveModel, View, WaveletPattern
from core.view_frame import turn_to

WINDOW_PX = 8
ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 2.6))
# The floor before the wall is in the picture, bare.
CAMERA = looking_along_y(
    position_m=(1.7, -2.0, 1.3), width_px=640, height_px=600, focal_px=720.0, principal_px=(370.0, 235.0)
)
PERSON = RoomObject(name="person", lower_m=(0.83, 1.21, 0.0), upper_m=(1.26, 1.63, 1.31))
DESK = RoomObject(name="desk", lower_m=(2.1, 1.4, 0.0), upper_m=(3.3, 2.2, 0.74))
SHELF = RoomObject(name="shelf", lower_m=(2.2, 2.6, 1.6), upper_m=(3.4, 3.0, 2.0))


def room(objects=()):
    solve = SolveModel(window_px=WINDOW_PX)
    return Scene(room=ROOM, views=(View(camera=CAMERA),), light=FixedTexture(), objects=objects, solve=solve)


def seen(scene, things, seed=0, world=IDEAL):
    """The reference of a room in which these things stand, in the light of a world without its own things."""
    picture = with_objects(render_reference(scene), replace(scene, objects=tuple(things)), 0)
    spoilt = spoiled(picture, world.world.model_copy(update={"covered": 0.0}), 0, seed)
    noise = 1e-3 * np.random.default_rng(seed).standard_normal(picture.shape)
    return (spoilt + noise).astype(np.float32)


def found(scene, picture):
    covered = covered_windows(scene, 0, picture, WINDOW_PX)
    return covered, found_things(scene, 0, picture, covered, WINDOW_PX)


def hidden_share(things):
    """Of each window, how much the things hide."""
    rows, columns = (n // WINDOW_PX for n in (CAMERA.height_px, CAMERA.width_px))
    pixels = np.stack(np.meshgrid(np.arange(columns * WINDOW_PX), np.arange(rows * WINDOW_PX)), axis=-1)
    hidden = hidden_by_objects(room(tuple(things)), 0, pixels.reshape(-1, 2).astype(float), 0.0)
    return hidden.reshape(rows, WINDOW_PX, columns, WINDOW_PX).mean(axis=(1, 3)).ravel()


def silhouette(item):
    """Which pixels of the picture it hides, of every fourth row and column."""
    pixels = np.stack(np.meshgrid(np.arange(0.0, 640, 4), np.arange(0.0, 600, 4)), axis=-1).reshape(-1, 2)
    return hidden_by_objects(room((item,)), 0, pixels, 0.0)


def overlap(one, other):
    a, b = silhouette(one), silhouette(other)
    return (a & b).sum() / (a | b).sum()


@pytest.mark.parametrize("world", [IDEAL, LAB], ids=["ideal", "lab"])
@pytest.mark.parametrize("seed", range(2))
def test_the_windows_behind_a_thing_are_left_out_and_hardly_any_other(world, seed):
    scene = room((DESK,))
    covered, _ = found(scene, seen(scene, (PERSON, DESK), seed, world))

    share = hidden_share((PERSON,))
    used = sees_wall(scene, 0, window_centres((600, 640), WINDOW_PX), margin_px=float(WINDOW_PX))
    whole, free = used & (share == 1.0), used & (share == 0.0)
    assert whole.sum() > 100
    assert covered[whole].mean() >= 0.95
    assert covered[free].mean() <= 0.02


@pytest.mark.parametrize("world", [IDEAL, LAB], ids=["ideal", "lab"])
def test_a_person_whose_foot_is_seen_stands_where_it_stands(world):
    scene = room((DESK,))
    _, (one,) = found(scene, seen(scene, (PERSON, DESK), 3, world))

    assert (one.depth, one.solved) == ("seen", True)
    assert one.box.name == "found 1"
    # A window is 0.06 m on the wall; its depth is taken, not seen.
    np.testing.assert_allclose(one.box.lower_m, PERSON.lower_m, atol=0.08)
    np.testing.assert_allclose(one.box.upper_m, PERSON.upper_m, atol=0.16)
    assert overlap(one.box, PERSON) > 0.8


def test_before_a_side_wall_a_thing_is_found_along_the_rooms_axes():
    scene, picture = room((DESK,)), seen(room((DESK,)), (PERSON, DESK))
    _, (ahead,) = found(scene, picture)
    # The same room and picture, turned so that what was y_max is x_min.
    back = turn_to("x_min").back()
    view = replace(scene.views[0], wall="x_min", camera=back.optics(CAMERA))
    aside = replace(scene, room=back.box(ROOM), views=(view,), objects=(back.thing(DESK),))
    _, (one,) = found(aside, picture)

    stands = back.thing(ahead.box)
    np.testing.assert_allclose(one.box.lower_m, stands.lower_m, atol=1e-6)
    np.testing.assert_allclose(one.box.upper_m, stands.upper_m, atol=1e-6)
    assert (one.solved, one.view, one.wall) == (True, 0, "x_min")
    low, high = one.x_m
    assert stands.lower_m[1] - 0.5 < low < high < stands.upper_m[1] + 0.5
    assert f"y {low:.2f} to {high:.2f} m" in one.sentence
    assert f"it stands at x = {stands.upper_m[0]:.2f} m" in one.sentence


def test_the_foot_below_the_picture_is_told():
    low = crop(CAMERA, slice(0, 505), slice(0, 640))
    scene = replace(room(), views=(View(camera=low),))
    _, (one,) = found(scene, seen(scene, (PERSON,)))

    assert (one.depth, one.solved) == ("at most", False)
    assert "or nearer to the camera" in one.sentence
    assert one.box.lower_m[1] > PERSON.lower_m[1]


def test_a_shelf_hangs_at_the_wall():
    _, (one,) = found(room(), seen(room(), (SHELF,)))

    assert one.depth == "unknown"
    assert "does not reach the floor" in one.sentence
    assert one.box.upper_m[1] == ROOM.upper_m[1]
    assert one.box.lower_m[2] > 1.5
    assert overlap(one.box, SHELF) > 0.8


def test_in_a_projectors_light_the_shadow_is_told_and_nothing_is_solved_with_it():
    projector = replace(CAMERA, position_m=(2.2, -2.0, 1.9), width_px=1200, height_px=1200)
    light = ProjectedPattern(pattern=WaveletPattern(finest_px=4.0), projector=projector)
    scene = replace(room(), light=light)
    covered, things = found(scene, seen(scene, (PERSON,)))
    assert covered[hidden_share((PERSON,)) == 1.0].any()
    assert things
    assert not any(one.solved for one in things)
    assert all("shadow" in one.sentence for one in things)


def test_what_is_found_stands_in_the_room_that_is_solved():
    picture = seen(room(), (PERSON, SHELF))
    standing = what_stands(room(), [picture])

    # The person, whose foot is seen; not the shelf, of which only the direction is known.
    assert [one.solved for one in standing.things] == [True, False]
    (person,) = standing.scene.objects
    assert (person.name, person.thermal) == ("found 1", "power")
    assert person.power_std_w >= 50.0


def test_two_things_are_two_and_named_apart_from_what_is_stated():
    stated = replace(SHELF, name="found 1")
    scene = room((stated,))
    _, things = found(scene, seen(scene, (PERSON, DESK, stated)))

    assert [one.box.name for one in things] == ["found 2", "found 3"]
    assert overlap(things[0].box, PERSON) > 0.8
    assert overlap(things[1].box, DESK) > 0.8


@pytest.mark.parametrize("world", [IDEAL, LAB], ids=["ideal", "lab"])
@pytest.mark.parametrize("seed", range(4))
def test_a_room_in_which_nothing_but_the_stated_stands_proposes_nothing(world, seed):
    scene = room((DESK,))
    covered, things = found(scene, seen(scene, (DESK,), seed, world))
    assert things == ()
    assert covered.mean() < 0.005


def test_what_is_proposed_can_be_stated_and_is_then_found_no_more():
    picture = seen(room(), (PERSON,))
    _, (one,) = found(room(), picture)
    (entry,) = tomllib.loads(one.entry)["scene"]["objects"]
    # As it is told: its last lines can be pasted below what airlens wrote.
    _, _, lines = one.sentence.partition("\n")
    written = to_toml(ExperimentSettings(scene=room()))
    assert from_toml(f"{written}\n{lines}\n", ExperimentSettings, "experiment.toml").scene.objects == (
        one.box,
    )
    stated = RoomObject(name=entry["name"], lower_m=tuple(entry["lower_m"]), upper_m=tuple(entry["upper_m"]))
    assert stated == one.box
    assert found(room((stated,)), picture)[1] == ()


def test_a_result_keeps_what_was_found_and_an_older_one_has_nothing():
    _, things = found(room(), seen(room(), (PERSON,)))
    assert found_in({"found": to_plain(things)}) == things
    assert found_in({}) == ()
