"""Boxes, cameras and whole scenes at their limits; units that were mixed up."""

from dataclasses import replace

import numpy as np

from core.geometry import Box, Optics, looking_along_y, rotation_matrix, rotation_vector
from core.scene import (
    CameraNoise,
    FixedTexture,
    FlowModel,
    Heater,
    Inlet,
    Outlet,
    Patch,
    ProjectedPattern,
    RayModel,
    Scene,
    SolveModel,
    View,
    Wall,
)
from tests.extremes.row import Near, Refused, Row, extremes, prove

ROOM = Box(lower_m=(0.0, 0.0, 0.0), upper_m=(4.0, 3.0, 3.0))
CAMERA = looking_along_y(position_m=(2.0, -5.0, 1.5), width_px=64, height_px=48, focal_px=100.0)
PATCH = Patch(wall="x_min", lower_m=(1.0, 1.0), upper_m=(2.0, 2.0))
STAGE = "geometry"


def box(name: str, size_m: tuple[float, float, float], expected) -> Row:
    return Row(STAGE, name, lambda: Box(lower_m=(0.0, 0.0, 0.0), upper_m=size_m).size_m, expected)


def camera(name: str, words: str, **changed) -> Row:
    return Row(STAGE, f"camera with {name}", lambda: replace(CAMERA, **changed).focal_px, Refused(words))


def scene(name: str, expected, **changed) -> Row:
    given = {"room": ROOM, "views": (View(camera=CAMERA),), "light": FixedTexture()} | changed
    return Row(STAGE, f"scene with {name}", lambda: float(len(Scene(**given).views)), expected)


def placed(name: str, position_m: tuple[float, float, float], expected) -> Row:
    return scene(name, expected, views=(View(camera=replace(CAMERA, position_m=position_m)),))


def made(name: str, make, words: str) -> Row:
    return Row(STAGE, name, make, Refused(words))


def inlet(**changed) -> Inlet:
    return Inlet(**({"patch": PATCH, "temperature_k": 300.0, "velocity_m_s": (0.5, 0.0, 0.0)} | changed))


def turned(angle_rad: float) -> Row:
    """A rotation vector back from its matrix, up to half a turn."""
    vector = np.array([0.6, -0.48, 0.64]) * angle_rad
    return Row(
        STAGE,
        f"rotation by {angle_rad:g} rad and back",
        lambda: np.array(rotation_vector(rotation_matrix(tuple(map(float, vector))))),
        Near(vector, abs=2e-8),
    )


ROWS = [
    box("box of 1 cm", (0.01, 0.01, 0.01), Near(0.01)),
    box("box of 100 m", (100.0, 100.0, 100.0), Near(100.0)),
    box("box in millimetres", (4100.0, 3000.0, 3000.0), Refused("millimetres")),
    box("bench in millimetres", (1500.0, 1000.0, 800.0), Refused("millimetres")),
    box("box of a micrometre", (1e-6, 1.0, 1.0), Refused("extent along x")),
    box("flat box", (4.0, 0.0, 3.0), Refused("no extent along y")),
    box("box inside out", (4.0, -1.0, 3.0), Refused("no extent along y")),
    box("endless box", (float("inf"), 1.0, 1.0), Refused("no extent along x")),
    box("box of NaN", (float("nan"), 1.0, 1.0), Refused("no extent along x")),
    camera("no pixels", "at least 1 x 1", width_px=0),
    camera("focal length in mm", "25 mm over 5 um", width_px=4096, focal_px=(25.0, 25.0)),
    camera("focal length 0", "positive|expected", focal_px=(0.0, 100.0)),
    camera("focal length NaN", "expected", focal_px=(float("nan"), 100.0)),
    camera("a place that is not finite", "not finite", position_m=(float("inf"), -5.0, 1.0)),
    camera("distortion that is not finite", "not finite", distortion=(float("nan"), 0.0, 0.0, 0.0, 0.0)),
    *[turned(a) for a in (0.0, 1e-12, 1e-6, 1.0, np.pi - 1e-6)],
    placed("camera 0.3 m from the wall", (2.0, 2.7, 1.5), Near(1.0)),
    placed("camera 1000 m from the wall", (2.0, -997.0, 1.5), Near(1.0)),
    placed("camera in millimetres", (2000.0, -5000.0, 1500.0), Refused("millimetres")),
    placed("camera in the wall", (2.0, 3.0, 1.5), Refused("behind the back wall")),
    scene("no view", Refused("no view"), views=()),
    scene(
        "the projector behind the wall",
        Refused("behind the back wall"),
        light=ProjectedPattern(projector=replace(CAMERA, position_m=(2.0, 5.0, 1.5))),
    ),
    scene(
        "the projector in millimetres",
        Refused("millimetres"),
        light=ProjectedPattern(projector=replace(CAMERA, position_m=(2000.0, -29000.0, 1500.0))),
    ),
    scene(
        "a 10 m baseline",
        Near(1.0),
        light=ProjectedPattern(projector=replace(CAMERA, position_m=(12.0, -5.0, 1.5))),
    ),
    made("no frames", lambda: View(camera=CAMERA, frames=0), "at least one frame"),
    made("f/0", lambda: View(camera=CAMERA, f_number=0.0), "number on the lens"),
    made("lens in millimetres", lambda: View(camera=CAMERA, focal_m=25.0), "25 mm is 0.025"),
    made("1 bit under 64 dark counts", lambda: CameraNoise(bits=1), "dark_counts"),
    made("17 bits", lambda: CameraNoise(bits=17), "1 to 16"),
    made("no full well", lambda: CameraNoise(full_well_e=0.0), "full_well_e > 0"),
    made("endless full well", lambda: CameraNoise(full_well_e=float("inf")), "full_well_e"),
    made("read noise NaN", lambda: CameraNoise(read_noise_e=float("nan")), "read_noise_e"),
    made("printed pixel of 1 (mm for m)", lambda: FixedTexture(pixel_m=1.0), "1 mm is 0.001"),
    made("printed pixel of 0", lambda: FixedTexture(pixel_m=0.0), "metres"),
    made("patch inside out", lambda: Patch(wall="x_min", lower_m=(1.0, 1.0), upper_m=(0.0, 2.0)), "no area"),
    made("inlet in Celsius", lambda: inlet(temperature_k=20.0), "Celsius"),
    made("inlet at 0 K", lambda: inlet(temperature_k=0.0), "kelvin"),
    made("inlet in mm/s", lambda: inlet(velocity_m_s=(500.0, 0.0, 0.0)), "500 mm/s is 0.5"),
    made("inlet speed NaN", lambda: inlet(velocity_m_s=(float("nan"), 0.0, 0.0)), "metres a second"),
    made("inlet known exactly", lambda: inlet(temperature_std_k=0.0), "nothing is known exactly"),
    made("turbulence of 10 (percent)", lambda: inlet(turbulence_intensity=10.0), "10 % is 0.1"),
    made("outlet in Celsius", lambda: Outlet(patch=PATCH, mean_temperature_k=22.0), "Celsius"),
    made("heater in Celsius", lambda: Heater(patch=PATCH, temperature_k=60.0), "Celsius"),
    made(
        "wall in Celsius",
        lambda: Wall(wall="x_min", thermal="temperature", temperature_k=18.0),
        "Celsius",
    ),
    made("wall with two truths", lambda: Wall(wall="x_min", temperature_k=290.0), "and only then"),
    made("no ray step", lambda: RayModel(steps=0), "steps"),
    made("1e9 ray steps", lambda: RayModel(steps=10**9), "steps"),
    made("no samples", lambda: RayModel(samples_per_pixel=0), "samples_per_pixel"),
    made("a grid of one cell", lambda: SolveModel(grid=1), "grid"),
    made("a grid of 1e6 cells an axis", lambda: SolveModel(grid=10**6), "grid"),
    made("a window of 0 px", lambda: SolveModel(window_px=0), "window_px"),
    made("viscosity 0", lambda: FlowModel(transport="given", viscosity_m2_s=0.0), "viscosity_m2_s"),
    Row(
        STAGE,
        "sensor of 1 px",
        lambda: float(
            Optics(
                width_px=1,
                height_px=1,
                focal_px=(1.0, 1.0),
                principal_px=(0.0, 0.0),
                position_m=(0.0, 0.0, 0.0),
                rotation_rad=(0.0, 0.0, 0.0),
            ).width_px
        ),
        Near(1.0),
    ),
]


@extremes(ROWS)
def test_geometry_at_its_limits(row: Row, record_property):
    prove(row, record_property)
