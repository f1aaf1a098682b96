"""Other answers for a scene: only what is answered otherwise changes, whatever else the scene holds.

`before` and `after` are what the old and the new answers describe; a part that both describe alike stays as the scene
has it, with all that no answer says.
"""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar, cast

from pydantic import BaseModel

from app.experiment.folder import ExperimentSettings
from app.experiment.rig_settings import RigSettings
from app.setup.answers import Answers
from app.setup.readback import blows_in
from core.objects import RoomObject
from core.scene import BoundaryInformation, Heater, Inlet, Outlet, PointSensors, Scene, View, Wall

T = TypeVar("T")


def changed_settings(
    old: ExperimentSettings,
    told: tuple[Answers, Answers],
    described: tuple[ExperimentSettings, ExperimentSettings],
    view: View,
    listed: frozenset[str],
) -> ExperimentSettings:
    """The settings with what is answered otherwise. Raises SettingError where parts do not fit together.

    `told`, `described`: the answers and what they describe, before and after; `view`: the one that they ask about;
    `listed`: the tables of sensors that they list.
    """
    before, after = described
    scene = replace(
        old.scene,
        **{
            name: merged(*(getattr(one.scene, name) for one in (old, before, after)))
            for name in ("room", "air", "light")
        },
        views=_views(old.scene, view, told, (before.scene, after.scene)),
        boundary=_boundary(old.scene, told, (before.scene, after.scene), listed),
        objects=_objects(old.scene, told, (before.scene, after.scene)),
    )
    return old.model_copy(
        update={
            "title": merged(old.title, before.title, after.title),
            "rig": _rig(old.rig, told, (before.rig, after.rig)),
            "scene": scene,
        }
    )


def merged(old: Any, before: Any, after: Any) -> Any:
    """`old` with what differs between `before` and `after`, part by part."""
    if before == after:
        return old
    if type(old) is type(before) is type(after):
        if is_dataclass(old) and not isinstance(old, type):
            names = [one.name for one in fields(old)]
            return replace(old, **_parts(names, old, before, after))
        if isinstance(old, BaseModel):
            return old.model_copy(update=_parts(list(type(old).model_fields), old, before, after))
        if isinstance(old, tuple) and len(old) == len(before) == len(after):
            return tuple(merged(*three) for three in zip(old, before, after, strict=True))
    return after


def _parts(names: list[str], old: Any, before: Any, after: Any) -> dict[str, Any]:
    return {name: merged(*(getattr(one, name) for one in (old, before, after))) for name in names}


def _sources(before: Sequence[Any], after: Sequence[Any]) -> dict[int, int]:
    """Which old answer each new one is: an equal one, else those that are left, in their order; more are new."""
    free = list(range(len(before)))
    source: dict[int, int] = {}
    for number, answer in enumerate(after):
        same = next((n for n in free if before[n] == answer), None)
        if same is not None:
            free.remove(same)
            source[number] = same
    for number in range(len(after)):
        if number not in source and free:
            source[number] = free.pop(0)
    return source


def _list(olds: Sequence[T], source: dict[int, int], before: Sequence[T], after: Sequence[T]) -> list[T]:
    """What each new answer makes: its old one with what differs in it, or a new one."""
    return [
        cast(T, merged(olds[source[n]], before[source[n]], item)) if n in source else item
        for n, item in enumerate(after)
    ]


def _views(
    old: Scene, asked: View, told: tuple[Answers, Answers], made: tuple[Scene, Scene]
) -> tuple[View, ...]:
    """The view that `camera` answers, and the others as answers tell them: these where it is the first."""
    first = merged(asked, made[0].views[0], made[1].views[0])
    if asked is not old.views[0]:
        return tuple(first if one is asked else one for one in old.views)
    source = _sources(told[0].view, told[1].view)
    return (first, *_list(old.views[1:], source, made[0].views[1:], made[1].views[1:]))


def _rig(
    old: RigSettings, told: tuple[Answers, Answers], made: tuple[RigSettings, RigSettings]
) -> RigSettings:
    """The devices; a further camera keeps its own whatever it is called now."""
    source = _sources(told[0].view, told[1].view)
    kept, before, after = (dict(one.cameras or {}) for one in (old, *made))
    names = [view.name for view in told[0].view]
    cameras = {name: device for name, device in kept.items() if name not in names}
    for number, view in enumerate(told[1].view):
        was = names[source[number]] if number in source else ""
        device = merged(kept.get(was), before.get(was), after.get(view.name))
        if device is not None:
            cameras[view.name] = device
    return merged(old, *made).model_copy(update={"cameras": cameras or None})


def _boundary(
    old: Scene, told: tuple[Answers, Answers], made: tuple[Scene, Scene], listed: frozenset[str]
) -> tuple[BoundaryInformation, ...]:
    """What is known at the boundary: what no answer says first, then what they say."""
    if made[0].boundary == made[1].boundary and _sensors(told[0]) == _sensors(told[1]):
        return old.boundary
    found: list[BoundaryInformation] = []
    for kind, name in ((Inlet, "supply"), (Outlet, "outlet"), (Heater, "surface")):
        source = _sources(*(getattr(one, name) for one in told))
        olds, before, after = (
            [one for one in _asked(scene) if isinstance(one, kind)] for scene in (old, *made)
        )
        found += _list(olds, source, before, after)
    found += _walls(old, made)
    source = old if _sensors(told[0]) == _sensors(told[1]) else made[1]
    tables = [one for one in source.boundary if isinstance(one, PointSensors)]
    unlisted = [one for one in old.boundary if isinstance(one, PointSensors) and one.file not in listed]
    unsaid = [
        one for one in old.boundary if not isinstance(one, Wall | PointSensors) and one not in _asked(old)
    ]
    tables += [one for one in unlisted if one not in tables]
    return (*unsaid, *found, *tables)


def _asked(scene: Scene) -> list[BoundaryInformation]:
    """Supplies, outlets and surfaces that answers can say, in their order."""
    return [
        one
        for one in scene.boundary
        if isinstance(one, Outlet | Heater) or (isinstance(one, Inlet) and blows_in(one) > 0)
    ]


def _sensors(answers: Answers) -> tuple[Any, ...]:
    return answers.thermometer, answers.anemometer


def _walls(old: Scene, made: tuple[Scene, Scene]) -> list[Wall]:
    olds, before, after = (
        {one.wall: one for one in scene.boundary if isinstance(one, Wall)} for scene in (old, *made)
    )
    found: list[Wall] = []
    for name, wall in after.items():
        if name in olds:
            found.append(cast(Wall, merged(olds[name], before[name], wall)))
        elif before[name] != wall:
            found.append(wall)
    return found


def _objects(old: Scene, told: tuple[Answers, Answers], made: tuple[Scene, Scene]) -> tuple[RoomObject, ...]:
    """Objects keep their names; a new one has that of its kind, with a number that is free."""
    source = _sources(told[0].object, told[1].object)
    before, after = (tuple(replace(one, name=_kind(one.name)) for one in scene.objects) for scene in made)
    taken = {one.name for one in old.objects}
    found: list[RoomObject] = []
    for number, item in enumerate(_list(old.objects, source, before, after)):
        found.append(item if number in source else replace(item, name=_free(item.name, taken)))
        taken.add(found[-1].name)
    return tuple(found)


def _kind(name: str) -> str:
    """A name without its number."""
    return name.rstrip("0123456789 ")


def _free(name: str, taken: set[str]) -> str:
    numbered = (f"{_kind(name)} {number}" for number in range(1, len(taken) + 2))
    return next(one for one in numbered if one not in taken)
