"""Experiments, and what may be changed of them."""

from typing import Annotated, Any, Literal

from pydantic import Field

from app.api.models.board import BoardGeometry
from app.api.models.strict import WireModel


class NextResource(WireModel):
    """The first step of the work that is not done, the command that does it, and why."""

    step: Literal[
        "camera",
        "plan",
        "print pattern",
        "print board",
        "calibrate",
        "calibrate together",
        "reference",
        "flow",
        "reconstruct",
        "report",
        "export",
    ]
    command: str
    reason: str


class SeenWallLine(WireModel):
    """A view: what it is called, the wall that it looks at, and whose camera takes its pictures.

    `camera` is the number of the view whose camera is opened for it, mostly its own; `camera_of` names that view
    where it is another one. `light` is what patterns the wall, `lamp` the number of the first view that has it, and
    `spoken_to` whether the rig names how that one's projector is reached.
    """

    name: str
    wall: str
    camera: int
    camera_of: str | None = None
    light: Literal["texture", "projector"]
    lamp: int
    spoken_to: bool


class ExperimentLine(WireModel):
    """One line of the list of experiments; `uncalibrated` names the parts of the rig that need it still.

    `reason` says what is wrong with an experiment that cannot be read: then only its name and date are known.
    `revision` goes into the `If-Match` of a change.
    """

    experiment: str
    title: str
    information: str
    camera: str
    projector: bool
    light: Literal["texture", "projector"]
    calibrated: bool
    uncalibrated: list[str]
    planned: bool
    captures: int
    results: int
    changed: str
    revision: str
    views: list[SeenWallLine]
    next: NextResource | None = None
    reason: str = ""


class ExperimentResource(ExperimentLine):
    """One experiment with its rig and scene as they stand in experiment.toml."""

    settings: dict[str, Any]


class NewExperiment(WireModel):
    """A simulated rig before the packaged room; real rigs are described in experiment.toml."""

    kind: Literal["simulated"]
    title: str = Field(default="Simulated room", min_length=1, max_length=200)
    camera_px: int = Field(default=384, ge=64, le=4096)
    light: Literal["texture", "projector"] = "texture"
    boundary: Literal["paper", "operator", "surveyed"] = "surveyed"
    world: Literal["ideal", "lab"] = "lab"


# Column and row, in a request.
Corner = Annotated[list[Annotated[float, Field(ge=0, le=100_000)]], Field(min_length=2, max_length=2)]


class MarksModel(WireModel):
    """A region of the first view's picture in which a still board or marks near the camera stand: its two corners."""

    name: str = Field(min_length=1, max_length=200)
    lower_px: Corner
    upper_px: Corner


class ExperimentChange(WireModel):
    """What people wrote about it, the board that its rig is calibrated with, and the marks in its first picture."""

    title: str | None = Field(default=None, max_length=200)
    information: str | None = Field(default=None, max_length=10_000)
    board: BoardGeometry | None = None
    marks: list[MarksModel] | None = Field(default=None, max_length=50)
