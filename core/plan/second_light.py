"""What a second projector would add: the same camera and wall, lit in turn from the other side of the camera.

Light bends on its way to the wall as well, so a second projector is a second line of sight through the air, without a
second camera. Two projectors in turn take twice the frames: it is worth its place where it finds more than twice the
frames under the first one would.
"""

from dataclasses import dataclass, replace

import numpy as np

from core.geometry import Vector3
from core.plan.expected import ExpectedFlow
from core.plan.observability import Seen, prior_root, rows_of, share_of
from core.plan.places import turned
from core.plan.signal import Signal, signal
from core.scene import ProjectedPattern, Scene, View
from core.view_frame import turn_to


@dataclass(frozen=True)
class SecondLight:
    """Where it would stand, and shares of an unknown flow's variance that the images fix.

    `images` with it, `twice_the_frames` without it and with as many frames in all.
    """

    position_m: Vector3
    images: float
    twice_the_frames: float

    @property
    def helps(self) -> bool:
        """Whether it finds more than the frames that it takes would find under the first projector."""
        return self.images > self.twice_the_frames


def second_light(scene: Scene, flow: ExpectedFlow, first: Signal, determined: Seen) -> SecondLight | None:
    """A second projector for the first view; None where that has a print, or more than one projector already.

    `first` is what that view sees, `determined` what all of them determine.
    """
    view = _beside(scene)
    if view is None or not isinstance(view.light, ProjectedPattern):
        return None
    with_it = replace(scene, views=(*scene.views, view))
    root = prior_root(scene, flow)
    number, rows = len(scene.views), determined.rows
    added = rows_of(with_it, number, flow, signal(with_it, number, flow, first.noise)) @ root
    # Twice the frames of the first view have half its variance.
    twice = [np.sqrt(2.0) * rows[0], *rows[1:]]
    return SecondLight(
        view.light.projector.position_m,
        share_of(np.concatenate([*rows, added]), root),
        share_of(np.concatenate(twice), root),
    )


def _beside(scene: Scene) -> View | None:
    """The first view under a projector that is mirrored at its camera, no lower than floor and ceiling allow."""
    first = scene.views[0]
    light = first.light or scene.light
    if not isinstance(light, ProjectedPattern) or any(view.camera_of == first.name for view in scene.views):
        return None
    turn = turn_to(first.wall)
    room, lamp, eye = (
        turn.box(scene.room),
        turn.optics(light.projector),
        turn.point(first.camera.position_m),
    )
    x_m, _, z_m = (2 * at - there for at, there in zip(eye, lamp.position_m, strict=True))
    z_m = min(max(z_m, room.lower_m[2]), room.upper_m[2])
    mirrored = turn.back().optics(turned(lamp, room.upper_m[1], (x_m, lamp.position_m[1], z_m)))
    other = replace(light, projector=mirrored)
    return replace(first, name=f"{first.name}, light 2", light=other, camera_of=first.name)
