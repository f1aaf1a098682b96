"""`draft` of single bursts against the newest reference: what does not change from burst to burst is worked out once.

The same functions as in `app.pipeline`, a burst in the place of the flow: measure, problem, solve. T is that of the
preset `draft`, without its deviations, which take six solves more.
"""

import contextlib
import math
from dataclasses import dataclass, replace
from pathlib import Path

import equinox as eqx
import numpy as np
from jaxtyping import Float

from app.errors import AirlensError
from app.experiment.captures import CapturePair, load_capture
from app.experiment.folder import Experiment, open_experiment
from app.reconstruct.found import what_stands
from app.reconstruct.measure import measure
from app.reconstruct.problem import known_of, problem_of
from core.displacement import resolve_window_px, window_centres
from core.known_temperature import VertexGrid
from core.problem import Problem, ShiftMeasurement
from core.rays.visibility import sees_wall
from core.result import Solution
from core.scene import Scene
from core.setting import SettingError
from core.solve.draft.draft import RayMatrix, draft_grid, solve_draft
from core.solve.draft.temperature_prior import TemperatureSettings

_T_ALONE = TemperatureSettings(draws=0)


@dataclass(frozen=True)
class BurstSeen:
    """T of one burst, and when it was taken.

    `noise_k` is how much of what differs from burst to burst is the pictures' noise, rms [K].
    """

    solution: Solution
    created: str
    noise_k: float


class BurstDraft:
    """Ready for the bursts of an experiment.

    Raises BadInputError for what is missing: a calibration, a reference.
    """

    def __init__(self, folder: Path) -> None:
        self._experiment = open_experiment(folder)
        self._known = known_of(self._experiment)
        self._stamp = _stamp(self._experiment)
        self._reference = load_capture(self._experiment.latest_capture("reference"))
        scene, pictures = self._known.scene, [image.mean for image in self._reference.images]
        self._standing = what_stands(scene, pictures)
        self._grid = draft_grid(scene)
        self._rays = [_Rays(scene, view, one.shape, self._grid) for view, one in enumerate(pictures)]
        self._noise_k = math.nan

    @property
    def is_current(self) -> bool:
        """Whether the experiment has this reference, these settings and this calibration yet."""
        return _stamp(self._experiment) == self._stamp

    def of(self, capture: Path) -> BurstSeen:
        """T of a burst. Raises BadInputError, SettingError for one that says nothing."""
        captures = CapturePair(self._reference, load_capture(capture))
        created = str(captures.flow.manifest.get("created", ""))
        measured = measure(captures, self._known.scene, standing=self._standing)
        problem = problem_of(replace(self._known, scene=measured.scene), measured.shifts, measured.images)
        found = self._solved(problem)
        if math.isnan(self._noise_k):
            shaken = eqx.tree_at(lambda one: one.shifts, problem, tuple(map(_with_noise, problem.shifts)))
            self._noise_k = _rms(self._solved(shaken).temperature_k - found.temperature_k)
        return BurstSeen(found.without_objects(problem.scene.objects), created, self._noise_k)

    def rehearse(self) -> None:
        """Look at the reference itself, so that the first burst finds everything compiled. Tells nothing."""
        with contextlib.suppress(AirlensError, SettingError):
            self.of(self._reference.folder)
        self._noise_k = math.nan

    def _solved(self, problem: Problem) -> Solution:
        return solve_draft(problem, _T_ALONE, rays=lambda view, centres: self._rays[view].at(centres))


class _Rays:
    """The rays of every window of a view's picture that sees the wall."""

    def __init__(self, scene: Scene, view: int, shape: tuple[int, int], grid: VertexGrid) -> None:
        window_px = resolve_window_px(scene, scene.views[view])
        centres = window_centres(shape, window_px)
        seen = centres[sees_wall(scene, view, centres, margin_px=float(window_px))]
        self._number = {tuple(centre): n for n, centre in enumerate(seen)}
        self._matrix = RayMatrix.of(scene, view, seen, grid, window_px)

    def at(self, centres_px: Float[np.ndarray, "windows 2"]) -> RayMatrix:
        return self._matrix.at(np.array([self._number[tuple(centre)] for centre in centres_px]))


def _with_noise(shift: ShiftMeasurement) -> ShiftMeasurement:
    """The shifts with as much noise again."""
    spread = np.linalg.cholesky(np.linalg.inv(shift.information_per_px2))
    drawn = np.random.default_rng(0).standard_normal(shift.displacement_px.shape)
    return replace(shift, displacement_px=shift.displacement_px + np.einsum("wab,wb->wa", spread, drawn))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _stamp(experiment: Experiment) -> tuple[object, ...]:
    """What says that an experiment's reference, settings or calibration changed."""
    files = (experiment.folder / "experiment.toml", experiment.bundle_path)
    times = [path.stat().st_mtime_ns if path.exists() else 0 for path in files]
    return (experiment.latest_capture("reference").name, *times)
