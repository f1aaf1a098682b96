"""An experiment by conversation: `airlens new EXPERIMENT`."""

from collections.abc import Callable
from pathlib import Path

from app.errors import BadInputError
from app.experiment.folder import Experiment
from app.files.durable import write_text
from app.files.toml import to_toml
from app.interview.conversation import DRAFT_FILE, Person, Question, converse, read_lines
from app.interview.questions import Inventory, questions
from app.setup.experiment import ANSWERS_FILE, new_experiment

_GO_ON = "go on"
_ANEW = "begin anew"


def talk(folder: Path, person: Person, look: Callable[[], Inventory] = Inventory) -> Experiment:
    """Ask for everything and make the experiment. Until then the answers are in the folder, and are gone on with.

    Raises EOFError where the answers end too early, BadInputError for a folder that holds something else.
    """
    draft = folder / DRAFT_FILE
    if folder.exists() and (not folder.is_dir() or any(path != draft for path in folder.iterdir())):
        raise BadInputError(f"{folder} is not empty; give a new folder for the experiment.")
    _go_on_or_begin_anew(draft, person)
    inventory = look()
    text = to_toml(converse(lambda: questions(inventory), person, draft))
    lines = draft.read_text(encoding="utf-8")
    draft.unlink()
    try:
        return new_experiment(folder, text, ANSWERS_FILE)
    except BaseException:
        write_text(draft, lines)
        raise


def _go_on_or_begin_anew(draft: Path, person: Person) -> None:
    """Whoever has begun says whether the answers that are kept are gone on with."""
    kept = read_lines(draft)
    if not kept:
        return

    def check(line: str) -> str:
        if line not in (_GO_ON, _ANEW):
            raise ValueError(f"{line!r} is neither; expected {_GO_ON!r} or {_ANEW!r}.")
        return line

    asked = Question(f"{len(kept)} answers are kept; {_GO_ON} or {_ANEW}", check, _GO_ON)
    while True:
        try:
            answer = check(person.hear(asked).strip() or _GO_ON)
            break
        except ValueError as error:
            person.refuse(asked, str(error))
    if answer == _ANEW:
        draft.unlink()
