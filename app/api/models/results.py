"""Results, their fields, and how they compare with what is known."""

from typing import Any, Literal

from app.api.models.strict import WireModel

Kind = Literal["found", "derived", "uncertainty", "truth", "error"]
Form = Literal["nc", "h5", "vti", "csv", "zip", "png", "ply", "vtu", "pdf", "pvd"]


class PresetResource(WireModel):
    """A named way to solve."""

    preset: str
    about: str


class ResultLine(WireModel):
    """One line of the list of results. `interrupted` ones have no manifest and are never used.

    `reason` says why a `broken` one cannot be read.
    """

    result: str
    state: str
    created: str | None
    preset: str | None
    outcome: str | None
    reason: str = ""


class FieldResource(WireModel):
    """One scalar on the result's vertices; `low` and `high` leave out the walls, and a hundredth on each side."""

    name: str
    unit: str
    label: str
    kind: Kind
    minimum: float
    maximum: float
    low: float
    high: float
    mean: float


class FoundResource(WireModel):
    """Something before the wall that was not stated, and the box that would hide as much.

    `solved`: the air was solved with it. `answer` is the object to add to the experiment's answers; `entry` states
    the box in experiment.toml.
    """

    name: str
    sentence: str
    lower_m: list[float]
    upper_m: list[float]
    solved: bool
    answer: dict[str, Any]
    entry: str


class ResultResource(WireModel):
    """A result: its grid, its fields, how it ended, and the manifest that says where it came from.

    `doubts` are those of its notes that must be looked into before it is believed, the most telling first.
    `time_s` is when each burst of a sequence began; fields of a burst are asked for as NAME.NUMBER, from 0.
    """

    result: str
    x_m: list[float]
    y_m: list[float]
    z_m: list[float]
    time_s: list[float]
    fields: list[FieldResource]
    outcome: str
    advice: str
    solver_s: float
    notes: list[str]
    doubts: list[str]
    found: list[FoundResource]
    manifest: dict[str, Any]


class ScoreResource(WireModel):
    """One figure against the truth, in words."""

    name: str
    value: float
    unit: str


class ReadingResource(WireModel):
    """One quantity at one point sensor: measured, with its standard deviation, and found there."""

    name: str
    unit: str
    position_m: list[float]
    measured: float
    std: float
    found: float


class ComparisonResource(WireModel):
    """A result against what is known better; empty lists where nothing is."""

    scores: list[ScoreResource]
    readings: list[ReadingResource]
