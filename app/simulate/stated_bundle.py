"""The calibration of a simulated rig whose models are those that its scene states."""

from datetime import UTC, datetime

import numpy as np

from calibration.bundle import Bundle, CalibratedOptics, CalibratedWall, FurtherView, given_bundle
from core.geometry import face_of
from core.scene import Light, ProjectedPattern, Scene, View


def bundle_as_stated(scene: Scene) -> Bundle:
    """The bundle, of quality `given`, with every view's camera, projector, wall and response."""
    first, *others = scene.views
    own, last_m = _projector(first.light or scene.light), scene.room.upper_m[1]
    bundle = given_bundle(
        date=datetime.now(UTC).isoformat(timespec="seconds"),
        cameras={view.name: view.camera for view in scene.views},
        projector=None if own is None else own.optics,
        noise={view.name: view.noise for view in scene.views},
        back_wall_y_m=last_m,
        further=tuple(
            FurtherView(view.name, _projector(view.light or scene.light), _wall(scene, view))
            for view in others
        ),
    )
    return bundle if first.wall == "y_max" else bundle.with_view(first.name, True, wall=_wall(scene, first))


def _projector(light: Light) -> CalibratedOptics | None:
    return CalibratedOptics("projector", light.projector) if isinstance(light, ProjectedPattern) else None


def _wall(scene: Scene, view: View) -> CalibratedWall:
    """The room's own wall, its normal away from the room."""
    face = face_of(view.wall)
    point, normal = np.zeros(3), np.zeros(3)
    point[face.axis] = (scene.room.upper_m if face.upper else scene.room.lower_m)[face.axis]
    normal[face.axis] = 1.0 if face.upper else -1.0
    (px, py, pz), (nx, ny, nz) = point.tolist(), normal.tolist()
    return CalibratedWall((px, py, pz), (nx, ny, nz))
