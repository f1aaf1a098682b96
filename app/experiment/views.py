"""The views of an experiment, by their names."""

from app.errors import BadInputError
from app.experiment.folder import Experiment
from core.scene import FixedTexture


def view_names(experiment: Experiment) -> tuple[str, ...]:
    """What the scene's views are called, in their order."""
    return tuple(view.name for view in experiment.settings.scene.views)


def view_number(experiment: Experiment, name: str | None) -> int:
    """The number of the view called so; where there is one view it need not be named. Raises BadInputError."""
    names = view_names(experiment)
    if name is None and len(names) == 1:
        return 0
    known = ", ".join(repr(one) for one in names)
    if name is None:
        raise BadInputError(
            f"{experiment.folder.name} has {len(names)} views: {known}. Say which one is meant, by its name."
        )
    if name not in names:
        raise BadInputError(f"{experiment.folder.name} has no view {name!r}; its views are {known}.")
    return names.index(name)


def camera_number(experiment: Experiment, view: int) -> int:
    """The number of the view whose camera takes a view's pictures: mostly its own."""
    owner = experiment.settings.scene.views[view].camera_of
    return view if owner is None else view_names(experiment).index(owner)


def opened_for(experiment: Experiment, view: int) -> int:
    """The number of the view whose camera is opened for a view: a simulated rig has a twin for each."""
    simulated = experiment.settings.rig.camera_kind == "simulated"
    return view if simulated else camera_number(experiment, view)


def own_cameras(experiment: Experiment) -> tuple[int, ...]:
    """The numbers of the views that have a camera of their own."""
    return tuple(n for n, view in enumerate(experiment.settings.scene.views) if view.camera_of is None)


def lamp_number(experiment: Experiment, view: int) -> int:
    """The number of the view whose projector lights a view: the first of those of its wall that see by it."""
    scene = experiment.settings.scene
    lights = [(one.wall, one.light or scene.light) for one in scene.views]
    return lights.index(lights[view])


def lamps(experiment: Experiment) -> tuple[int, ...]:
    """The numbers of the views that each have a light of their own: one a wall, more where projectors take turns."""
    return tuple(sorted({lamp_number(experiment, n) for n in range(len(view_names(experiment)))}))


def printed_walls(experiment: Experiment) -> tuple[int, ...]:
    """Those whose wall bears a print."""
    scene = experiment.settings.scene
    return tuple(
        n for n in lamps(experiment) if isinstance(scene.views[n].light or scene.light, FixedTexture)
    )


def projectors(experiment: Experiment) -> tuple[int, ...]:
    """Those whose wall a projector lights."""
    return tuple(n for n in lamps(experiment) if n not in printed_walls(experiment))


def chosen_projectors(experiment: Experiment, view: str | None) -> dict[int, str]:
    """By their numbers the projectors, or the one that lights the view called so: whose each is, of several views.

    The first view's where there is none: who asks for its pattern is told so. Raises BadInputError.
    """
    names = view_names(experiment)
    found = projectors(experiment) or (0,)
    if view is not None:
        found = (lamp_number(experiment, view_number(experiment, view)),)
    return {number: names[number] if len(names) > 1 else "" for number in found}


def take_turns(experiment: Experiment) -> bool:
    """Whether one camera takes the pictures of several views, under one projector after the other."""
    return any(view.camera_of is not None for view in experiment.settings.scene.views)
