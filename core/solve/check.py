"""Problems that no iteration can save are refused before the first one, with the reason."""

import numpy as np

from core.geometry import Box, Vector3
from core.known import refuse_contradicted, refuse_outward, refuse_overlaps, stated_walls
from core.problem import Problem, ShiftMeasurement
from core.scene import Heater, Inlet, OnPatch, Outlet, Wall
from core.setting import SettingError
from core.solve.regime import Regime


def check_problem(problem: Problem, regime: Regime) -> None:
    """Raise SettingError where images or boundary information contradict themselves or say nothing."""
    if "bos" in regime:
        _check_shifts(problem)
    _check_planes(problem)
    _check_patches(problem)
    _check_supply(problem)
    _check_sensors(problem)
    if not problem.planes and not problem.scene.boundary and not problem.sensors:
        raise SettingError(
            "Nothing is known at the boundary, and deflections see only gradients: the level of the "
            "temperature is undetermined. Add a plane, an inlet, a wall or a sensor to the scene."
        )


def _check_shifts(problem: Problem) -> None:
    if not problem.shifts and not problem.images:
        raise SettingError(
            "There is no image of any view, but the regime uses images. Capture a reference and a flow "
            "image, or take the regime pde+boundary."
        )
    for view, shift in zip(problem.scene.views, problem.shifts, strict=False):
        _check_shift(view.name, shift)


def _check_shift(name: str, shift: ShiftMeasurement) -> None:
    if len(shift.centres_px) == 0:
        raise SettingError(
            f"View {name!r} sees no window of the patterned wall. "
            "Check that the wall is inside the picture and that the pattern is in focus."
        )
    values = (shift.displacement_px, shift.information_per_px2)
    if not all(np.isfinite(v).all() for v in values):
        raise SettingError(
            f"View {name!r} has measured shifts that are not finite (noise of zero, or saturated pixels). "
            "State the camera's noise, lower the exposure, and capture again."
        )
    strength = np.linalg.eigvalsh(shift.information_per_px2)
    if not (strength[:, 0] > 0).any():
        raise SettingError(
            f"View {name!r} has no window with texture in both directions; the shift cannot be measured. "
            "Use a pattern with finer texture, or a larger window."
        )
    if strength.max() > 1e14:
        raise SettingError(
            f"View {name!r} claims shifts to {strength.max() ** -0.5:.1g} px: its noise is zero. "
            "State full_well_e and read_noise_e of the camera."
        )
    if (strength[:, 1] < 1.0).all():
        raise SettingError(
            f"View {name!r} knows no shift better than 1 px, thousands of times the signal of warm air. "
            "Check that the wall is inside the view and that the images are not saturated."
        )


def _check_planes(problem: Problem) -> None:
    walls = [plane.wall for plane in problem.planes]
    for wall in walls:
        if walls.count(wall) > 1:
            raise SettingError(
                f"The plane {wall} is given {walls.count(wall)} times; give one field a plane."
            )
    for plane in problem.planes:
        fields = (plane.temperature_k, plane.pressure_m2_s2, plane.velocity_m_s)
        if not all(np.isfinite(field).all() for field in fields):
            raise SettingError(
                f"The plane {plane.wall} holds values that are not finite. "
                "Leave out the plane, or fill its gaps."
            )
        if plane.temperature_k.min() <= 0:
            raise SettingError(
                f"The plane {plane.wall} has a temperature of {plane.temperature_k.min():g} K; "
                "expected kelvin."
            )


def _check_patches(problem: Problem) -> None:
    parts = [item for item in problem.scene.boundary if isinstance(item, OnPatch)]
    stated_walls(problem.scene)
    refuse_overlaps(parts)
    for inlet in (item for item in parts if isinstance(item, Inlet)):
        refuse_outward(inlet)


def _check_supply(problem: Problem) -> None:
    """Supplies and heaters against what a plane measured there, supplies against a room that lets nothing out."""
    scene = problem.scene
    inlets = [item for item in scene.boundary if isinstance(item, Inlet)]
    for plane in problem.planes:
        for part in (p for p in scene.boundary if isinstance(p, Inlet | Heater)):
            refuse_contradicted(part, plane, scene.air.ambient_temperature_k)
    closed = {item.wall for item in scene.boundary if isinstance(item, Wall) and item.no_slip}
    lets_out = problem.planes or any(isinstance(item, Outlet) for item in scene.boundary)
    if inlets and not lets_out and len(closed) == 6:
        raise SettingError(
            f"Air enters through {len(inlets)} inlet(s), all six walls are closed, and there is no outlet: mass "
            "cannot be conserved. Add the outlet, or leave out a wall that is not closed."
        )


def _in_room(room: Box, point_m: Vector3) -> bool:
    """A sensor on a wall is in the room."""
    return all(low <= p <= high for low, p, high in zip(room.lower_m, point_m, room.upper_m, strict=True))


def _check_sensors(problem: Problem) -> None:
    for sensor in problem.sensors:
        for point in np.atleast_2d(sensor.position_m):
            x, y, z = (float(c) for c in point)
            if not _in_room(problem.scene.room, (x, y, z)):
                raise SettingError(
                    f"A sensor at ({x:g}, {y:g}, {z:g}) m is outside the room "
                    f"{problem.scene.room.lower_m} to {problem.scene.room.upper_m} m. "
                    "Check its position and its unit."
                )
        known = np.isfinite(sensor.temperature_k)
        if (np.asarray(sensor.temperature_std_k)[known] <= 0).any():
            raise SettingError("A thermometer has uncertainty 0; give its standard deviation in kelvin.")
