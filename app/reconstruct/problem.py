"""What is known of a room besides its pictures, and the problem that both make: its one door."""

from dataclasses import dataclass, replace

from app.errors import BadInputError
from app.experiment.boundary import read_planes, read_sensors
from app.experiment.calibration import read_bundle
from app.experiment.folder import Experiment
from calibration.bundle import Bundle
from calibration.errors import CalibrationError
from core.problem import ImagePair, PlaneData, Problem, SensorData, ShiftMeasurement
from core.scene import Scene
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
    views = []
    for view in scene.views:
        response = bundle.response(view.name)
        noise = response.noise if response else view.noise
        views.append(replace(view, camera=bundle.camera(view.name).optics, noise=noise))
    light = scene.light
    if bundle.projector is not None and light.kind == "projector":
        light = replace(light, projector=bundle.projector.optics)
    source = bundle.camera(scene.views[0].name).quality.source
    return replace(scene, views=tuple(views), light=light), f"Calibration of {bundle.date}, camera {source}."
