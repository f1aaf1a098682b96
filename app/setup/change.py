"""Other answers for a scene: only what is answered otherwise changes, whatever else the scene holds.

`before` and `after` are what the old and the new answers describe; a part that both describe alike stays as the scene
has it, with all that no answer says.
"""

from dataclasses import replace
from typing import Any, cast

from app.experiment.folder import ExperimentSettings
from app.setup.answers import Answers
from app.setup.change_views import changed_rig, changed_views
from app.setup.merge import merged, merged_list, sources
from core.objects import RoomObject
from core.scene import BoundaryInformation, Heater, Inlet, Outlet, PointSensors, Scene, View, Wall


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
        views=changed_views(old.scene, view, told, (before.scene, after.scene)),
        boundary=_boundary(old.scene, told, (before.scene, after.scene), listed),
        objects=_objects(old.scene, told, (before.scene, after.scene)),
    )
    return old.model_copy(
        update={
            "title": merged(old.title, before.title, after.title),
            "rig": changed_rig(old.rig, told, (before.rig, after.rig)),
            "scene": scene,
        }
    )


def _boundary(
    old: Scene, told: tuple[Answers, Answers], made: tuple[Scene, Scene], listed: frozenset[str]
) -> tuple[BoundaryInformation, ...]:
    """What is known at the boundary: what no answer says first, then what they say."""
    if made[0].boundary == made[1].boundary and _sensors(told[0]) == _sensors(told[1]):
        return old.boundary
    found: list[BoundaryInformation] = []
    for kind, name in ((Inlet, "supply"), (Outlet, "outlet"), (Heater, "surface")):
        source = sources(*(getattr(one, name) for one in told))
        olds, before, after = (
            [one for one in _asked(scene) if isinstance(one, kind)] for scene in (old, *made)
        )
        found += merged_list(olds, source, before, after)
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
        if isinstance(one, Outlet | Heater) or (isinstance(one, Inlet) and one.inward_m_s > 0)
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
    source = sources(told[0].object, told[1].object)
    before, after = (tuple(replace(one, name=_kind(one.name)) for one in scene.objects) for scene in made)
    taken = {one.name for one in old.objects}
    found: list[RoomObject] = []
    for number, item in enumerate(merged_list(old.objects, source, before, after)):
        found.append(item if number in source else replace(item, name=_free(item.name, taken)))
        taken.add(found[-1].name)
    return tuple(found)


def _kind(name: str) -> str:
    """A name without its number."""
    return name.rstrip("0123456789 ")


def _free(name: str, taken: set[str]) -> str:
    numbered = (f"{_kind(name)} {number}" for number in range(1, len(taken) + 2))
    return next(one for one in numbered if one not in taken)
