"""Kind `places`: what the camera of answers would see from other places, before there is an experiment."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pydantic import Field

from app.errors import BadInputError
from app.files.reading import read_json
from app.files.toml import Strict, parse
from app.jobs.attempt import Attempt
from app.setup.answers import Answers
from app.setup.mistakes import field_name, mistakes_in

if TYPE_CHECKING:
    from pathlib import Path

    from app.experiment.plan import PlacesLine

EXPERIMENT = False


class PlacesSettings(Strict):
    """The answers, as answers.toml holds them."""

    answers: dict[str, Any] = Field(max_length=100)


def read(settings: Mapping[str, Any]) -> PlacesSettings:
    """Return the settings. Raises BadInputError that tells every mistake in the answers."""
    found = parse(dict(settings), PlacesSettings, source="the settings of a job for places")
    wrong = mistakes_in(found.answers)
    if wrong:
        raise BadInputError("; ".join(f"{field_name(one.path)}: {one.sentence}" for one in wrong))
    return found


def run(attempt: Attempt, settings: PlacesSettings) -> dict[str, Any]:
    """March the expected flow coarsely and look at it from each place, measured from the room's corner."""
    # Imported here: reading a job's settings must not cost the start of the array library.
    from app.plan.make import places_of
    from app.setup.scene import settings_of

    attempt.tell("stage", {"stage": "march the expected flow, then look at it from each place"})
    scene = settings_of(parse(settings.answers, Answers, "answers")).scene
    return {"places": places_of(scene).model_dump()}


def read_places(result: "Path") -> "PlacesLine":
    """What a finished job found; `result` is its folder. Raises BadInputError."""
    from app.experiment.plan import PlacesLine

    told = read_json(result / "result.json", "Submit the job again.").get("summary", {})
    return parse(told.get("places", {}), PlacesLine, source="result.json")
