"""What is known of a room besides its pictures, and the problem that both make: its one door."""

from dataclasses import dataclass, replace

from app.errors import BadInputError
from app.experiment.boundary import read_planes, read_sensors
from app.experiment.calibration import read_bundle
from app.experiment.folder import Experiment
from calibration.bundle import Bundle, CalibratedOptics
from calibration.errors import CalibrationError
from core.geometry import Optics
from core.problem import ImagePair, PlaneData, Problem, SensorData, ShiftMeasurement
from core.scene import Light, ProjectedPattern, Scene, View
from core.solve.check import check_problem
from core.solve.recipes import regime_for


@dataclass(frozen=True)
class Known:
    """The calibrated scene, what was measured at the boundary, and a sentence on where the optics come from."""

    scene: Scene
    planes: tuple[PlaneData, ...] = ()
    sensors: tuple[SensorData, ...] = ()
    optics: str = ""


def known_of(experiment: Experiment) -> Known:
    """What the experiment knows without a picture. Raises BadInputError."""
    scene, optics = _calibrated(experiment)
    return Known(scene, read_planes(experiment, scene), read_sensors(experiment, scene), optics)


def problem_of(
    known: Known, shifts: tuple[ShiftMeasurement, ...], images: tuple[ImagePair, ...] = ()
) -> Problem:
    """The checked problem. Raises SettingError where what is known contradicts itself or the shifts say nothing."""
    problem = Problem(known.scene, shifts, known.planes, known.sensors, images)
    check_problem(problem, regime_for(problem))
    return problem


def with_scene(problem: Problem, scene: Scene) -> Problem:
    """The same measurements under another statement of the scene, checked again. Raises SettingError."""
    return problem_of(Known(scene, problem.planes, problem.sensors), problem.shifts, problem.images)


def _calibrated(experiment: Experiment) -> tuple[Scene, str]:
    """The scene with the calibrated optics and noise in place of the nominal ones, and a sentence on it."""
    scene, bundle = experiment.settings.scene, read_bundle(experiment.folder)
    if bundle is None:
        return scene, "Not calibrated: the optics are those written in experiment.toml."
    try:
        return _with_bundle(scene, bundle)
    except CalibrationError as error:
        raise BadInputError(f"{experiment.bundle_path} does not fit this scene: {error}") from error


def _with_bundle(scene: Scene, bundle: Bundle) -> tuple[Scene, str]:
    views = tuple(_calibrated_view(scene, number, bundle) for number in range(len(scene.views)))
    light = scene.light
    if scene.views[0].light is None:
        light = _lit(light, bundle.projector, _is_placed(scene, 0, bundle))
    source = bundle.camera(scene.views[0].name).quality.source
    told = f"Calibration of {bundle.date}, camera {source}."
    afar = [view.name for number, view in enumerate(scene.views) if not _is_placed(scene, number, bundle)]
    if afar:
        told += (
            f" The wall before {', '.join(afar)} is not calibrated, so what takes and lights its pictures stands "
            "where experiment.toml says. Take the step: airlens calibrate wall."
        )
    return replace(scene, views=views, light=light), told


def _is_placed(scene: Scene, number: int, bundle: Bundle) -> bool:
    """Whether the calibration tells where a view's camera stands in the room, by its wall or by other cameras.

    Before that the camera is the origin, which is no place in the room.
    """
    camera = _camera_of(scene.views[number])
    tied = bundle.joint is not None and camera in bundle.joint.parts
    return tied or bundle.of(camera, scene.views[0].name == camera).wall is not None


def _camera_of(view: View) -> str:
    return view.name if view.camera_of is None else view.camera_of


def _calibrated_view(scene: Scene, number: int, bundle: Bundle) -> View:
    """A view by what was calibrated with its own camera. A further one that shares the scene's projector then has a
    light of its own: that projector as its camera placed it. All but the projector of a view that another one's
    camera takes is that one's.
    """
    view, placed = scene.views[number], _is_placed(scene, number, bundle)
    camera = _camera_of(view)
    own, response = bundle.of(view.name, number == 0), bundle.response(camera)
    light = view.light
    if number > 0 and own.projector is not None:
        light = scene.light if light is None else light
    light = None if light is None else _lit(light, own.projector, placed)
    noise = response.noise if response else view.noise
    optics = _standing(bundle.camera(camera).optics, view.camera, placed)
    return replace(view, camera=optics, noise=noise, light=light)


def _lit(light: Light, projector: CalibratedOptics | None, placed: bool) -> Light:
    """The light by its calibrated projector, where it is one."""
    if projector is None or not isinstance(light, ProjectedPattern):
        return light
    return replace(light, projector=_standing(projector.optics, light.projector, placed))


def _standing(calibrated: Optics, stated: Optics, placed: bool) -> Optics:
    """The calibrated lens where the calibration places it, or else where the scene states it."""
    if placed:
        return calibrated
    return replace(calibrated, position_m=stated.position_m, rotation_rad=stated.rotation_rad)
