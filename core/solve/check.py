"""Problems that no iteration can save are refused before the first one, with the reason."""

import numpy as np

from core.geometry import Box, Vector3
from core.problem import PlaneData, Problem, ShiftMeasurement
from core.scene import Inlet, Outlet, Wall
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
    inlets = [item for item in problem.scene.boundary if isinstance(item, Inlet)]
    outlets = [item for item in problem.scene.boundary if isinstance(item, Outlet)]
    walls = [item.wall for item in problem.scene.boundary if isinstance(item, Wall)]
    for wall in walls:
        if walls.count(wall) > 1:
            raise SettingError(f"The wall {wall} is described {walls.count(wall)} times; describe it once.")
    placed = [*inlets, *outlets]
    for place, first in enumerate(placed):
        for second in placed[place + 1 :]:
            if first.patch.wall == second.patch.wall and _overlap(first.patch, second.patch):
                raise SettingError(
                    f"The {first.kind} and the {second.kind} on {first.patch.wall} overlap "
                    f"({first.patch.lower_m} to {first.patch.upper_m} m and {second.patch.lower_m} to "
                    f"{second.patch.upper_m} m): they contradict each other. Move one."
                )
    for inlet in inlets:
        axis, sign = "xyz".index(inlet.patch.wall[0]), 1 if inlet.patch.wall.endswith("min") else -1
        if sign * inlet.velocity_m_s[axis] < 0:
            raise SettingError(
                f"The inlet on {inlet.patch.wall} has velocity {inlet.velocity_m_s} m/s, which leaves "
                "the room. Turn its sign, or call it an outlet."
            )


def _check_supply(problem: Problem) -> None:
    """Inlets against what a plane measured there, and against a room that lets nothing out."""
    scene = problem.scene
    inlets = [item for item in scene.boundary if isinstance(item, Inlet)]
    for plane in problem.planes:
        for inlet in (i for i in inlets if i.patch.wall == plane.wall):
            _check_inlet_on_plane(inlet, plane, scene.air.ambient_temperature_k)
    closed = {item.wall for item in scene.boundary if isinstance(item, Wall) and item.no_slip}
    lets_out = problem.planes or any(isinstance(item, Outlet) for item in scene.boundary)
    if inlets and not lets_out and len(closed) == 6:
        raise SettingError(
            f"Air enters through {len(inlets)} inlet(s), all six walls are closed, and there is no outlet: mass "
            "cannot be conserved. Add the outlet, or leave out a wall that is not closed."
        )


def _check_inlet_on_plane(inlet: Inlet, plane: PlaneData, ambient_k: float) -> None:
    """The middle half of the patch: a measured edge is smeared."""
    inside = []
    for axis_m, low, high in zip(
        (plane.first_m, plane.second_m), inlet.patch.lower_m, inlet.patch.upper_m, strict=True
    ):
        quarter = (high - low) / 4
        inside.append((axis_m > low + quarter) & (axis_m < high - quarter))
    found = plane.temperature_k[np.ix_(*inside)]
    if found.size == 0:
        return
    measured_k = float(np.median(found))
    if abs(measured_k - inlet.temperature_k) > 1.0 + 0.25 * abs(inlet.temperature_k - ambient_k):
        raise SettingError(
            f"The inlet on {plane.wall} is stated at {inlet.temperature_k:g} K, and the plane {plane.wall} has "
            f"{measured_k:g} K in it: they contradict each other. Correct the one that is wrong, or leave it out."
        )


def _overlap(first, second) -> bool:
    return all(
        a_low < b_high and b_low < a_high
        for a_low, a_high, b_low, b_high in zip(
            first.lower_m, first.upper_m, second.lower_m, second.upper_m, strict=True
        )
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
