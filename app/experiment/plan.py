"""The plan of an experiment as it is kept, shown and sent: numbers and sentences, no computation."""

from typing import TYPE_CHECKING

from app.files.reading import read_json
from app.files.toml import Strict, parse

if TYPE_CHECKING:
    from app.experiment.folder import Experiment

PLAN_FILE = "plan.json"


class MapLine(Strict):
    """Length of the expected shift over the picture: rows of px / 1000 at window centres [px]."""

    columns_px: list[float]
    rows_px: list[float]
    shift_mpx: list[list[float | None]]


class PlacesLine(Strict):
    """What the camera would see from other places, as rows (y) of columns (x) at its height; null where none.

    Signal to noise of the picture and of a window, and the share of the wall that is seen. The camera now stands
    at `camera_m`; the room reaches from `lower_m` to `upper_m` along x and y.
    """

    x_m: list[float]
    y_m: list[float]
    picture_signal_to_noise: list[list[float | None]]
    signal_to_noise: list[list[float | None]]
    wall_share: list[list[float | None]]
    camera_m: list[float]
    lower_m: list[float]
    upper_m: list[float]


class ViewLine(Strict):
    """What one view would see. `frames_needed`: for the expected flow to stand out in one window."""

    name: str
    light: str
    window_px: int
    noise_px: float | None
    shift_median_px: float
    shift_p90_px: float
    shift_p99_px: float
    signal_to_noise: float
    picture_signal_to_noise: float
    smallest_visible_k: float | None
    frames: int
    frames_needed: float | None
    other_light: str
    other_light_shift_p99_px: float
    map: MapLine
    places: PlacesLine | None = None


class ChoiceLine(Strict):
    """One resolved `auto`: what it is held against, and its cost as a share of the dearest choice."""

    name: str
    value: bool | int | str
    bound: float
    limit: float
    unit: str
    cost_share: float
    reason: str


class SecondLightLine(Strict):
    """A second projector for the first camera, in turn with the first: where, and what the images would fix.

    `twice_the_frames`: what they would fix without it, by as many frames in all.
    """

    position_m: list[float]
    images: float
    twice_the_frames: float


class SeenLine(Strict):
    """Shares of an unknown temperature's variance that are found."""

    modes: int
    modes_seen: int
    images: float
    boundary: float
    both: float
    second_light: SecondLightLine | None = None


class PresetLine(Strict):
    """What a preset would cost and find; null where nothing predicts it. `fits` is false where it would refuse.

    `wall_s` is the whole run, `solver_s` of it compiling and solving; `compiled` tells whether its programs lie
    compiled. Times are told anew where a plan is shown, from `work`, in the solver's loops, and `programs`.
    """

    preset: str
    fits: bool
    wall_s: float | None = None
    solver_s: float | None
    compiled: bool = False
    work: float | None = None
    programs: str = ""
    memory_mb: float | None
    temperature_error_k: float | None
    velocity_error: float | None
    pressure_error: float | None
    reason: str


class AveragingLine(Strict):
    """How the air would move, and how long to average: a mean over `averaged_s` lies `error_k` from a long one.

    T departs from its mean by `fluctuation_k` (rms over the room), for about `stays_s` at a time.
    """

    fluctuation_k: float
    stays_s: float
    error_k: list[float]
    averaged_s: list[float]


class Plan(Strict):
    """Everything that can be said beforehand.

    `scene` is a hash of what was stated of the room then, `pixels` are those of all views.
    """

    schema_version: int = 1
    scene: str = ""
    pixels: float = 0.0
    expected: str
    expected_contrast_k: float
    expected_departure_k: float
    views: list[ViewLine]
    seen: SeenLine
    averaging: AveragingLine | None = None
    choices: list[ChoiceLine]
    presets: list[PresetLine]
    machine: str
    verdicts: list[str]


def read_plan(experiment: "Experiment") -> Plan | None:
    """The plan that was kept, or None. Raises BadInputError for a file that is none."""
    path = experiment.folder / PLAN_FILE
    if not path.is_file():
        return None
    return parse(read_json(path, "Make it again: `airlens plan`."), Plan, str(path))
