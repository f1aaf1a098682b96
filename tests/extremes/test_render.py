"""Images: 8 px to a line of 8192, from 0.3 m and 1000 m, edge-on, without contrast, one voxel."""

from dataclasses import replace
from functools import cache

import numpy as np

from core.fields import GridField
from core.geometry import Box, Optics, looking_along_y
from core.rays import StraightTracer
from core.render import pixel_geometry, render_flow, render_reference
from core.render.render_choice import choose
from core.render.shift import pattern_offset_px, wall_offset_m
from core.scene import (
    CheckerPattern,
    DotPattern,
    FixedTexture,
    Light,
    ProjectedPattern,
    RayModel,
    Scene,
    View,
    WaveletPattern,
)
from tests.extremes.row import Named, Near, Refused, Row, Within, extremes, prove

STAGE = "render"
ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(2.0, 2.0, 1.5))
# One compiled program for most rows: 64 x 48 px, steps and samples given, a print of 400 x 300 px.
RAYS = RayModel(tracer="straight", steps=8, samples_per_pixel=1)


def camera(stand_off_m: float = 4.0, cols: int = 64, rows: int = 48, room: Box = ROOM) -> Optics:
    x, y, z = room.upper_m[0] / 2, room.upper_m[1] - stand_off_m, room.upper_m[2] / 2
    focal_px = max(40.0 * stand_off_m / room.size_m[0] * cols / 64, 0.05 * max(cols, rows))
    return looking_along_y(position_m=(x, y, z), width_px=cols, height_px=rows, focal_px=focal_px)


def scene(optics: Optics, light: Light | None = None, room: Box = ROOM, rays: RayModel = RAYS) -> Scene:
    given = light or FixedTexture(pixel_m=room.size_m[0] / 400)
    return Scene(room=room, views=(View(camera=optics),), light=given, rays=rays)


def field(kelvin: float, room: Box = ROOM) -> GridField:
    """A slope across the view: `kelvin` of contrast over the room."""
    excess = -2.72e-4 * kelvin / (293.15 + kelvin)
    across = np.broadcast_to(np.linspace(0, excess, 3)[:, None, None], (3, 3, 3))
    return GridField(room.lower_m, room.upper_m, across.astype(np.float32))


@cache
def reference(world: Scene) -> np.ndarray:
    return render_reference(world)


def looks(name: str, world: Scene, expected) -> Row:
    return Row(STAGE, name, lambda: reference(world), expected)


def still(name: str, world: Scene) -> Row:
    """Air at rest gives the reference, bit for bit."""

    def run() -> np.ndarray:
        values = np.zeros((3, 3, 3), np.float32)
        return render_flow(world, GridField(world.room.lower_m, world.room.upper_m, values)) - reference(
            world
        )

    return Row(STAGE, f"still air: {name}", run, Near(0.0))


def flow(name: str, world: Scene, kelvin: float) -> Row:
    """The flow image stays a picture, and its change is no larger than the pattern's contrast."""

    def run() -> np.ndarray:
        return np.abs(render_flow(world, field(kelvin, world.room)) - reference(world))

    return Row(STAGE, f"{kelvin:g} K: {name}", run, Within(0.0, 1.0))


def shift(kelvin: float, stand_off_m: float) -> Row:
    """Shift in the middle of the picture against g L^2 / 2 times the lever of the pixels."""

    def run() -> float:
        world = scene(camera(stand_off_m))
        geometry = pixel_geometry(world, 0, np.array([[31.5, 23.5]]))
        offset_m = wall_offset_m(geometry, field(kelvin), StraightTracer(8, world.air.ambient_refractivity))
        return float(pattern_offset_px(geometry, offset_m)[0, 0])

    n0 = scene(camera()).air.ambient_refractivity
    slope_per_m = -2.72e-4 * kelvin / (293.15 + kelvin) / 2.0 / (1 + n0)
    length_m = min(stand_off_m, 2.0)
    # A print of 5 mm pixels.
    expected = slope_per_m * length_m**2 / 2 / 0.005
    return Row(STAGE, f"shift of {kelvin:g} K from {stand_off_m:g} m", run, Near(expected, rel=1e-5))


def resolved(name: str, world: Scene, kelvin: float | None, attribute: str, expected) -> Row:
    """What `auto` becomes."""

    def run():
        found = getattr(choose(world, 0, None if kelvin is None else field(kelvin, world.room)), attribute)
        return float(found) if isinstance(found, int | float) else type(found).__name__

    return Row(STAGE, f"auto {attribute}: {name}", run, expected)


def refused(name: str, words: str, world: Scene) -> Row:
    return Row(STAGE, name, lambda: reference(world), Refused(words))


BASE = scene(camera())
LAMP = replace(camera(4.0, 400, 300), focal_px=(500.0, 500.0))
PROJECTED = scene(camera(), ProjectedPattern(projector=LAMP))
AWAY = replace(camera(), rotation_rad=(-np.pi / 2, 0.0, 0.0))
EDGE = replace(camera(), position_m=(-3.0, 1.999, 0.75), rotation_rad=(0.0, np.pi / 2, 0.0))
SMALL = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(0.02, 0.02, 0.015))
LARGE = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(100.0, 100.0, 75.0))
AUTO = RayModel()
# A spline through the pattern overshoots at hard edges: 4 % where noise is clipped, 10 % at dots.
PICTURE = Within(-0.12, 1.12)

ROWS = [
    looks("a print", BASE, PICTURE),
    looks("a projector", PROJECTED, PICTURE),
    looks("from 0.3 m", scene(camera(0.3)), PICTURE),
    looks("from 1000 m", scene(camera(1000.0)), PICTURE),
    looks("a room of 2 cm", scene(camera(0.1, room=SMALL), room=SMALL), PICTURE),
    looks("a hall of 100 m", scene(camera(300.0, room=LARGE), room=LARGE), PICTURE),
    looks("no contrast", scene(camera(), FixedTexture(pixel_m=0.005, pattern=WaveletPattern(contrast=0.0))),
          Within(0.0, 0.501)),
    looks("a black wall", scene(camera(), FixedTexture(pixel_m=0.005, pattern=CheckerPattern(square_px=1e6))),
          Near(0.0, abs=1e-6)),
    looks("nothing but ink", scene(camera(), FixedTexture(pixel_m=0.005, pattern=DotPattern(coverage=0.99))),
          PICTURE),
    looks("a camera that looks away", scene(AWAY), Near(0.0)),
    looks("a wall edge-on", scene(EDGE), PICTURE),
    looks("8 x 8 px", scene(camera(4.0, 8, 8)), PICTURE),
    looks("8192 x 2 px", scene(camera(4.0, 8192, 2)), PICTURE),
    still("a print", BASE),
    still("a projector", PROJECTED),
    still("from 1000 m", scene(camera(1000.0))),
    still("a camera that looks away", scene(AWAY)),
    still("a hall of 100 m", scene(camera(300.0, room=LARGE), room=LARGE)),
    *[flow("a print", BASE, k) for k in (1e-3, 10.0, 2000.0)],
    flow("a projector", PROJECTED, 2000.0),
    flow("from 0.3 m", scene(camera(0.3)), 2000.0),
    flow("a wall edge-on", scene(EDGE), 10.0),
    *[shift(k, s) for k in (1e-3, 10.0, 2000.0) for s in (0.3, 3.0, 30.0, 1000.0)],
    resolved("no flow", scene(camera(), rays=AUTO), None, "projector_order", Near(1.0)),
    resolved("0.001 K", scene(camera(), rays=AUTO), 1e-3, "projector_order", Near(1.0)),
    resolved("2000 K", scene(camera(), rays=AUTO), 2000.0, "projector_order", Near(2.0)),
    resolved("coarse grid", scene(camera(), rays=AUTO), 1.0, "tracer", Named("NonlinearTracer")),
    resolved("8 x 8 px", scene(camera(4.0, 8, 8), rays=AUTO), 1.0, "stride", Within(0, 8)),
    resolved("8192 px", scene(camera(4.0, 8192, 2), rays=AUTO), 1.0, "stride", Within(1, 8192)),
    refused("a print of 1 um pixels", "pixel_m", scene(camera(), FixedTexture(pixel_m=1e-6))),
    refused("a print of one pixel", "at least 2 x 2",
            scene(camera(0.1, room=SMALL), FixedTexture(pixel_m=0.1), SMALL)),
    refused("an aperture without a lens", "f_number and focal_m",
            scene(camera(), rays=RayModel(steps=8, samples_per_pixel=1, aperture_cone=True))),
]  # fmt: skip


@extremes(ROWS)
def test_images_at_their_limits(row: Row, record_property):
    prove(row, record_property)
